"""The problem: what is asked, stated once and frozen. Mesh, material, section, supports, loads."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.conditions import Loading
from truespring.errors import LoadError, NoLoadError, ProblemError, TruespringError
from truespring.loading import LOADS, Body, Fixed, Held, Load, Spread, held_by, nodal_force
from truespring.material import Material, Section, Solid
from truespring.memory import slices
from truespring.mesh import MIXED, Mesh, Selection, select_elements
from truespring.mesh.selections import AXES
from truespring.modes import centred, modes_at, n_modes
from truespring.potential import Potential

_Found = TypeVar("_Found")


@dataclass(frozen=True)
class Region:
    """A part of the body of another `material`.

    `on` is an element group of the mesh, a Box that holds the centres of its elements, or element numbers.
    """

    on: Selection
    material: Material


@dataclass(frozen=True, eq=False)
class Problem:
    """A body, how it is held and what pulls at it.

    `material` and `section` may be absent where the model brings its own stiffness (a SpringNetwork);
    a body in three dimensions has the section Solid by itself. Where `regions` overlap the last one counts.
    `stated` is false of a body that another program's file tells of, without what held and loaded it: it has a mesh
    only, and cannot be solved.
    Raises ProblemError or MeshError where the parts do not fit, nothing loads the body, or the
    supports leave it, or a part of it that nothing joins to the rest, free to move as a rigid body.
    """

    mesh: Mesh
    material: Material | None = None
    section: Section | None = None
    supports: Sequence[Fixed] = field(default=())
    loads: Sequence[Load] = field(default=())
    regions: Sequence[Region] = field(default=())
    stated: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "regions", _several(self.regions, Region, "regions", "Region"))
        object.__setattr__(self, "supports", _several(self.supports, Fixed, "supports", "Fixed"))
        object.__setattr__(self, "loads", _several(self.loads, Load, "loads", _LOADS))
        if self.material is not None and self.mesh.element_dim == 2 and self.section is None:
            raise ProblemError("a plane body needs a section: PlaneStress(thickness) or PlaneStrain(thickness)")
        if self.mesh.element_dim == 3 and self.section is None:
            object.__setattr__(self, "section", Solid())
        if self.section is not None and (self.section.dim == 3) != (self.mesh.element_dim == 3):
            raise ProblemError(f"section = {self.section!r} does not fit a mesh of {self.mesh.kinds} elements")
        if self.regions and self.material is None:
            raise ProblemError("regions of another material need a material for the rest")
        _ = self.material_numbers  # a region that selects nothing is refused here
        if not self.stated:
            return
        loading = self.loading
        acting = loading.external_force[~loading.held].any() or loading.following
        if not acting and not loading.motion().any():
            held = " in a direction that is free" if loading.external_force.any() else ""
            raise NoLoadError(
                f"nothing loads the body{held}: give a load, or a support with a displacement that is not zero"
            )
        self._refuse_rigid_motion()

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """Each material that an element has, once: that of the body, then those of the regions; empty without one."""
        return tuple(self._materials[0])

    @cached_property
    def material_numbers(self) -> Ints:
        """The place in `materials` of each element's own, shape (n_elements,)."""
        return self._materials[1]

    @cached_property
    def _materials(self) -> tuple[list[Material], Ints]:
        if self.material is None:
            return [], np.zeros(len(self.mesh.elements), dtype=np.int64)
        named = list(dict.fromkeys([self.material, *(region.material for region in self.regions)]))
        numbers = np.zeros(len(self.mesh.elements), dtype=np.int64)
        for region in self.regions:
            numbers[select_elements(self.mesh, region.on)] = named.index(region.material)
        used = np.bincount(numbers, minlength=len(named)) > 0
        return [material for material, there in zip(named, used, strict=True) if there], (np.cumsum(used) - 1)[numbers]

    @cached_property
    def homogeneous(self) -> "tuple[Problem, ...]":
        """The problem once for each of `materials`, its body all of that one; itself where there is but one."""
        if not self.regions:
            return (self,)
        return tuple(replace(self, material=material, regions=()) for material in self.materials)

    @cached_property
    def blocks(self) -> "tuple[tuple[Ints, Problem], ...]":
        """The body kind by kind of its elements: their numbers, and a problem of them alone without what acts on it."""
        if self.mesh.element != MIXED:
            return ((np.arange(len(self.mesh.elements)), self),)
        return tuple(
            (
                numbers,
                replace(
                    self,
                    mesh=part,
                    supports=(),
                    loads=(),
                    regions=_regions_of(self, self.material_numbers[numbers]),
                    stated=False,
                ),
            )
            for numbers, part in self.mesh.blocks
        )

    def of_elements(self, value: Callable[[Material], float]) -> Floats:
        """Return a value of each element's own material, shape (n_elements,)."""
        return np.array([value(material) for material in self.materials])[self.material_numbers]

    @cached_property
    def loading(self) -> Loading:
        """Forces and prescribed displacements at load factor 1."""
        held, displacement = np.zeros(self.mesh.nodes.shape, dtype=bool), np.zeros(self.mesh.nodes.shape)
        moved = np.zeros(self.mesh.nodes.shape)
        for support in self.held:
            motion = np.tile(support.motion, (len(support.nodes), 1))
            if support.turn is not None:
                motion = motion + support.turn.motion(1.0)
            for axis in support.directions:
                self._refuse_two_motions(support.nodes, axis, held, moved, motion[:, axis])
                held[support.nodes, axis] = True
                displacement[support.nodes, axis] = support.motion[axis]
                moved[support.nodes, axis] = motion[:, axis]
        turns = tuple(support.turn for support in self.held if support.turn is not None)
        force = nodal_force(self.spreads(self.body), self.mesh.nodes.shape)
        return Loading(force, held, displacement, turns, self.following(self.body, held))

    @cached_property
    def held(self) -> tuple[Held, ...]:
        """What each support holds."""
        return tuple(held_by(self.mesh, support) for support in self.supports)

    @cached_property
    def body(self) -> Body:
        """What loads act on."""
        dense = bool(self.materials) and all(material.density is not None for material in self.materials)
        density = self.of_elements(lambda material: material.density or 0.0) if dense else None
        return Body(self.mesh, 1.0 if self.section is None else self.section.thickness, density)

    def spreads(self, body: Body) -> tuple[Spread, ...]:
        """Return the dead loads over the cells of `body` that carry them; it may have more nodes than the mesh."""
        return tuple(self._of_each_load(lambda load: load.spread(body)))

    def following(self, body: Body, held: Bools) -> tuple[Potential, ...]:
        """Return the loads that follow `body`, whose nodes are held where `held` is true, shape (n_nodes, dim)."""
        return tuple(self._of_each_load(lambda load: load.following(body, held)))

    def _of_each_load(self, ask: Callable[[Load], _Found | None]) -> Iterator[_Found]:
        """Yield what each load answers, if anything; an error names the load."""
        for number, load in enumerate(self.loads):
            try:
                found = ask(load)
            except TruespringError as error:
                raise LoadError(number, str(error)) from None
            if found is not None:
                yield found

    @property
    def rims(self) -> Ints:
        """The edges that loads in space need held around their surfaces, by their ends, shape (n, 2)."""
        return np.concatenate([np.zeros((0, 2), dtype=np.int64), *(load.rim(self.mesh) for load in self.loads)])

    def scaled(self, factor: float) -> "Problem":
        """Return the problem with every load and every prescribed motion times a factor."""
        loads = [load.scaled(factor) for load in self.loads]
        return replace(self, loads=loads, supports=[support.scaled(factor) for support in self.supports])

    def _refuse_two_motions(self, nodes: Ints, axis: int, held: Bools, moved: Floats, motion: Floats) -> None:
        clash = np.flatnonzero(held[nodes, axis] & (moved[nodes, axis] != motion))
        if clash.size:
            first = int(clash[0])
            raise ProblemError(
                f"two supports move node {nodes[first]} along {AXES[axis]} by {moved[nodes[first], axis]:g} m and by "
                f"{motion[first]:g} m: a node has one prescribed motion"
            )

    def _refuse_rigid_motion(self) -> None:
        """Name a rigid motion that no support hinders: equilibrium would not be unique, or not exist."""
        parts = self.mesh.parts
        by_part = np.argsort(parts, kind="stable")
        several = np.split(by_part, np.flatnonzero(np.diff(parts[by_part])) + 1)
        for nodes in several:
            free = _rigid_freedom(self.mesh.nodes[nodes], self.loading.held[nodes])
            if free is None:
                continue
            body = "the body"
            if len(several) > 1:
                place = ", ".join(f"{coordinate:.6g}" for coordinate in self.mesh.nodes[nodes].mean(axis=0))
                body = (
                    f"one of {len(several)} parts that nothing joins, disconnected without support enough "
                    f"({len(nodes)} nodes about ({place}) m),"
                )
            raise ProblemError(
                f"the supports leave {body} free to move {free} as a rigid body: hold more directions or more nodes"
            )


def sample(problem: Problem, elements: Ints) -> Problem:
    """Return the elements of these numbers alone, each apart from the others, as a problem: held, moved somehow."""
    mesh, numbers = problem.mesh, problem.material_numbers[elements]
    nodes = np.arange(mesh.kind.n_nodes * len(elements))
    corners = mesh.elements[elements]
    return replace(
        problem,
        mesh=Mesh(mesh.nodes[corners.ravel()], nodes.reshape(corners.shape), mesh.element),
        supports=[Fixed(on=nodes, displacement=(1.0,) * mesh.dim)],  # type: ignore[arg-type]
        loads=(),
        regions=_regions_of(problem, numbers),
    )


def _regions_of(problem: Problem, numbers: Ints) -> list[Region]:
    """The regions of elements with the material of these numbers."""
    return [
        Region(np.flatnonzero(numbers == number), material)  # type: ignore[arg-type]
        for number, material in enumerate(problem.materials)
        if (numbers == number).any() and len(problem.materials) > 1
    ]


def _rigid_freedom(nodes: Floats, held: Bools) -> str | None:
    """How `nodes` [m] may move as a rigid body though some of their directions are `held`, None where they can't."""
    if held.all():
        return None
    tolerance = 1e-9 * np.sqrt(nodes.size)  # nodes on a line have a turn that moves nothing
    hindered = _rigid_rank(nodes, held, tolerance)
    if hindered == n_modes(nodes.shape[1]) or 0 < hindered == _rigid_rank(nodes, np.ones_like(held), tolerance):
        return None
    free = [axis for axis, there in zip(AXES, held.T, strict=False) if not there.any()]
    return f"along {', '.join(free)}" if free else "by turning"


def _rigid_rank(nodes: Floats, chosen: Bools, tolerance: float) -> int:
    """The rank of the rigid-body modes of `nodes` [m] in the directions chosen: singular values above a tolerance."""
    places = centred(nodes)
    upper = np.zeros((0, n_modes(nodes.shape[1])))
    for part in slices(len(nodes), 8 * nodes.shape[1] * upper.shape[1]):
        if chosen[part].any():
            modes = modes_at(places[part])[chosen[part].ravel()]
            upper = np.asarray(np.linalg.qr(np.concatenate([upper, modes]), mode="r"))
    return int((np.linalg.svd(upper, compute_uv=False) > tolerance).sum())


def _several(given: object, kind: type, name: str, allowed: str) -> tuple[Any, ...]:
    """Return one or several of a kind as a tuple; raise ProblemError for anything else."""
    several = (given,) if isinstance(given, kind) else given
    if not isinstance(several, Sequence) or not all(isinstance(one, kind) for one in several):
        raise ProblemError(f"{name} = {given!r}: must be a list of {allowed}")
    return tuple(several)


_LOADS = " or ".join(kind.load.__name__ for kind in LOADS.values())
