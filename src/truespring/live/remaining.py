"""The problem of what a cut leaves: supports, loads, regions and grasps stay where they were, on what remains of it.

Selections are those of the body before, as numbers of nodes and elements: sides, planes and boxes are not looked up
again on the new surface.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Self, TypeVar

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import MeshError
from truespring.loading import Body, DeadLoad, Fixed, History, Load, Mark, Spread
from truespring.mesh import Remainder, Selection, facets_within, remainder, select, select_elements
from truespring.problem import Problem, Region
from truespring.tools import Grasp, Tool

_Acting = TypeVar("_Acting", Load, Tool)


@dataclass(frozen=True, eq=False)
class Left:
    """A problem of the elements that a cut leaves.

    Attributes:
        problem: the problem.
        of: its mesh, and where it was in that before.
        lost: names of grasps of the problem before of whose patch no node remains.
    """

    problem: Problem
    of: Remainder
    lost: tuple[str, ...]


def remaining(problem: Problem, elements: Ints) -> Left:
    """Return the problem of some elements of a body, their numbers ascending, shape (n,)."""
    facets = dict(_facets(problem))
    of = remainder(problem.mesh, elements, facets)
    supports = [_support(support, problem, of) for support in problem.supports]
    loads = [_load(_name("load", n, problem), one, problem, of, facets) for n, one in enumerate(problem.loads)]
    tools = [
        one if one.on is None else _moved(_name("tool", n, problem), one, problem, of, facets)
        for n, one in enumerate(problem.tools)
    ]
    grasps = [_grasp(grasp, problem, of) for grasp in problem.grasps]
    found = replace(
        problem,
        mesh=of.mesh,
        supports=[one for one in supports if one is not None],
        loads=[one for one in loads if one is not None],
        regions=_regions(problem, elements),
        tools=[one for one in tools if one is not None],
        grasps=[one for one in grasps if one is not None],
    )
    return Left(found, of, tuple(a.name for a, b in zip(problem.grasps, grasps, strict=True) if b is None))


def _regions(problem: Problem, elements: Ints) -> list[Region]:
    """Return a region for each material of the elements that remain, none if the body has one material."""
    if len(problem.materials) < 2:
        return []
    numbers = problem.material_numbers[elements]
    several = [(material, np.flatnonzero(numbers == number)) for number, material in enumerate(problem.materials)]
    return [Region(there.tolist(), material) for material, there in several if len(there)]


def _support(support: Fixed, problem: Problem, of: Remainder) -> Fixed | None:
    """Return what is left of a support, None if none of its nodes remains."""
    before = select(problem.mesh, support.on)
    nodes = of.left_of(before)
    if not len(nodes):
        return None
    if support.rotation and support.about is None:  # the centre of all its nodes, also of those that are gone
        support = replace(support, about=problem.mesh.nodes[before].mean(axis=0).tolist())
    return support.moved_to(nodes.tolist())


def _load(name: str, load: Load, problem: Problem, of: Remainder, facets: Mapping[str, Ints]) -> Load | None:
    """Return what is left of a load, None if nothing that carries it remains."""
    if load.on is None:
        return load
    if load.on_elements:
        elements = of.element_numbers[select_elements(problem.mesh, load.on)]
        there = elements[elements >= 0]
        return load.moved_to(there.tolist()) if len(there) else None
    spread = load.spread(problem.body)
    if spread is None:
        return _moved(name, load, problem, of, facets)
    holds = of.holds(spread.cells)
    if not holds.any():
        return None
    cells = of.numbers[spread.cells[holds]]
    return Remaining(load, cells, spread.measures[holds], spread.density[holds], load.over)


def _facets(problem: Problem) -> Iterator[tuple[str, Ints]]:
    """Yield name and facets, shape (n, k), of loads that follow the body and of tools, unless they name a group."""
    known = problem.mesh.facet_groups
    loads = [one if one.follows and not one.on_elements else None for one in problem.loads]
    for kind, several in (("load", loads), ("tool", problem.tools)):
        for number, one in enumerate(several):
            if one is None or one.on is None or (isinstance(one.on, str) and one.on in known):
                continue
            try:
                yield _name(kind, number, problem), facets_within(problem.mesh, one.on)
            except MeshError:  # nodes without a facet, as those of a moment may be
                continue


def _name(kind: str, number: int, problem: Problem) -> str:
    """Return a name of a group of facets that no mesh before has."""
    return f"{kind} {number} of {len(problem.mesh.elements)} elements"


def _moved(name: str, one: _Acting, problem: Problem, of: Remainder, facets: Mapping[str, Ints]) -> _Acting | None:
    """Return a load or tool on the facets or nodes that remain of its selection, None without any."""
    on: Selection | None = one.on
    assert on is not None  # what acts on the whole body is not moved
    group = name if name in facets else on
    if isinstance(group, str) and (name in facets or group in problem.mesh.facet_groups):
        return one.moved_to(group) if group in of.mesh.facet_groups else None
    nodes = of.left_of(select(problem.mesh, on))
    return one.moved_to(nodes.tolist()) if len(nodes) else None


def _grasp(grasp: Grasp, problem: Problem, of: Remainder) -> Grasp | None:
    """Return what is left of a grasp, None if none of its nodes remains."""
    young = max((material.young for material in problem.materials), default=None)
    nodes, stiffness = grasp.patch(problem.body, young)
    numbers = of.numbers[nodes]
    there = numbers >= 0
    if not there.any():
        return None
    known = (grasp.name, grasp.at, grasp.radius, grasp.path, grasp.stiffness, grasp.during, grasp.origin)
    return HeldPatch(*known, tuple(numbers[there].tolist()), tuple(stiffness[there].tolist()))


@dataclass(frozen=True)
class HeldPatch(Grasp):
    """What a cut leaves of a grasp: its nodes, whatever the surface is now.

    Attributes:
        nodes: the held nodes.
        springs: stiffness of the spring of each [N/m].
    """

    nodes: tuple[int, ...] = ()
    springs: tuple[float, ...] = ()

    def patch(self, body: Body, young: float | None) -> tuple[Ints, Floats]:
        """Return the held nodes and the stiffness of the spring of each [N/m], shape (n,)."""
        return np.array(self.nodes, dtype=np.int64), np.array(self.springs)


@dataclass(frozen=True, eq=False)
class Remaining(DeadLoad):
    """What a cut leaves of a dead load: its force on each cell that remains, as before.

    Attributes:
        load: the load before.
        cells: cells that carry it, by their corners, shape (n, k).
        measures: share of each corner in the measure of its cell [m^k], shape (n, k).
        density: force per length, area or volume of each cell [N/m^k], shape (n, dim).
        over: see Load.
        factor: what the load is multiplied by.
    """

    load: Load
    cells: Ints
    measures: Floats
    density: Floats
    over: History | None = None
    factor: float = 1.0

    @property
    def on(self) -> Selection:  # type: ignore[override]  # of this load the selection follows from the cells
        """The loaded nodes."""
        return np.unique(self.cells).tolist()  # type: ignore[no-any-return]

    def spread(self, body: Body) -> Spread:
        """Return the load over the cells that remain."""
        return Spread(*body.carrying(self.cells, self.measures), self.factor * self.density)

    def scaled(self, factor: float) -> Self:
        """Return the load multiplied by a factor."""
        return replace(self, factor=factor * self.factor)

    def turned(self, rotation: Floats) -> Self:
        """Return the load with its vector rotated by a matrix of shape (dim, dim)."""
        return replace(self, density=self.density @ rotation.T)

    def mark(self, body: Body, held: Bools) -> Mark:
        """Return an arrow along the total force."""
        total = self.factor * (self.measures.sum(axis=1) @ self.density)
        return Mark(np.unique(self.cells), total, "F", float(np.linalg.norm(total)), "N")

    def words(self) -> str:
        """Return the load before, and that it is what a cut left."""
        return f"{self.load.words()}, of which a cut left {len(self.cells)} facets or nodes"
