"""The problem to solve: mesh, material, section, regions, supports and loads."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.conditions import Amplitude, Loading, Turn
from truespring.dynamics import Dynamics
from truespring.errors import LoadError, NoLoadError, PartError, ProblemError, ToolError, TruespringError
from truespring.fibres import Families, families
from truespring.loading import (
    LOADS,
    Body,
    Fixed,
    Held,
    Load,
    amplitude_of,
    components,
    held_by,
    nodal_force,
    nodal_mass,
)
from truespring.material import WATER, Material, Section, Solid
from truespring.memory import slices
from truespring.mesh import MIXED, Mesh, Selection, element_corner_measures, select_elements
from truespring.mesh.selections import AXES
from truespring.rigid_modes import centred, modes_at, n_modes
from truespring.tools import TOOLS, Grasp, Tool, varies

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_Found = TypeVar("_Found")

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Region:
    """Elements of another `material`.

    `on` is an element group of the mesh, a Box that contains the centres of the elements, or element numbers.

    Example:
        >>> import truespring as ts
        >>> stiff = ts.Region(ts.Box((0.0, 0.0), (0.02, 0.01)), ts.Material(young=50e3, poisson=0.3))
        >>> stiff.material.young
        50000.0
    """

    on: Selection
    material: Material


@dataclass(frozen=True, eq=False)
class Problem:
    """A body with its supports and loads.

    Attributes:
        mesh: the mesh.
        material: the material; None if the model has its own stiffness (a SpringNetwork).
        section: PlaneStress or PlaneStrain for a plane body; in 3D Solid, the default.
        supports: supports, one or several.
        loads: loads, one or several.
        regions: elements of other materials; where regions overlap, the last one applies.
        stated: False if loads and supports need not define an equilibrium: for a result of another program, of which
            only the mesh is known, and for natural frequencies; such a problem cannot be solved.
        dynamics: the motion in time; None for equilibrium.
        tools: rigid bodies that touch the body.
        grasps: patches that are held by springs to a place that moves.

    Raises ProblemError or MeshError if the parts do not fit together, if there is no load, or if the body or a
    disconnected part of it can move as a rigid body.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.16, 0.04), (16, 4)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.0, -0.043))],
        ... )
    """

    mesh: Mesh
    material: Material | None = None
    section: Section | None = None
    supports: Sequence[Fixed] = field(default=())
    loads: Sequence[Load] = field(default=())
    regions: Sequence[Region] = field(default=())
    stated: bool = True
    dynamics: Dynamics | None = None
    tools: Sequence[Tool] = field(default=())
    grasps: Sequence[Grasp] = field(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "regions", _several(self.regions, Region, "regions", "Region"))
        object.__setattr__(self, "supports", _several(self.supports, Fixed, "supports", "Fixed"))
        object.__setattr__(self, "loads", _several(self.loads, Load, "loads", _LOADS))
        object.__setattr__(self, "tools", _several(self.tools, Tool, "tools", _TOOLS))
        object.__setattr__(self, "grasps", _several(self.grasps, Grasp, "grasps", "Grasp"))
        if self.material is not None and self.mesh.element_dim == 2 and self.section is None:
            raise ProblemError("a plane body needs a section: PlaneStress(thickness) or PlaneStrain(thickness)")
        if self.mesh.element_dim == 3 and self.section is None:
            object.__setattr__(self, "section", Solid())
        if self.section is not None and (self.section.dim == 3) != (self.mesh.element_dim == 3):
            raise ProblemError(f"section = {self.section!r} does not fit a mesh of {self.mesh.kinds} elements")
        if self.regions and self.material is None:
            raise ProblemError("regions need a material for the rest of the body")
        _ = self.material_numbers  # raises MeshError for a region without elements
        _ = self.fibres  # raises FibreError
        if not self.stated:
            return
        if self.dynamics is not None:
            self._check_motion(self.dynamics)
            return
        self._check_loaded()
        self._check_rigid_motion()

    def _check_loaded(self) -> None:
        """Raise NoLoadError if no load, motion, tool or grasp acts on free directions."""
        loading, free = self.loading, ~self.loading.held
        forced = any(part.external_force.any() for part in loading.parts)
        acting = any(part.external_force[free].any() or part.following for part in loading.parts)
        moved = any(part.displacement.any() or part.turns for part in loading.parts)
        if not acting and not moved and not loading.interactions:
            held = " in a direction that is free" if forced else ""
            raise NoLoadError(f"nothing loads the body{held}: add a load, or a support with a nonzero displacement")

    def _check_motion(self, dynamics: Dynamics) -> None:
        """Raise PartError if a motion has no mass, its velocity does not fit the body, or a support would jump."""
        if self.material is not None and self.body.density is None:
            places: list[tuple[tuple[str | int, ...], Material]] = [(("material", "density"), self.material)]
            places += [(("region", number, "density"), one.material) for number, one in enumerate(self.regions)]
            without = (place for place, one in places if one.density is None and one in self.materials)
            raise PartError(next(without), "a motion needs a density [kg/m^3] of the material and of each region")
        if dynamics.velocity is not None:
            try:
                components(dynamics.velocity, self.mesh.dim, "velocity", "m/s")
            except ProblemError as error:
                raise PartError(("dynamics", "velocity"), str(error)) from None
        for number, support in enumerate(self.supports):
            if support.over is None and (support.rotation or np.any(support.displacement or 0.0)):
                raise PartError(
                    ("support", number, "over"),
                    "a support that moves in a motion would jump at time 0: give its history, such as over = "
                    '[["0 s", 0], ["50 ms", 1]]',
                )
        _ = self.loading

    def _repr_html_(self) -> str:
        """Return the problem as HTML for a notebook: a table and a picture."""
        from truespring.showing.values import html_of

        return html_of(self)

    def plot(self, model: Any = None, ax: "Axes | None" = None) -> "Axes":
        """Draw the undeformed body with supports, loads and tools, as `truespring check` does.

        Args:
            model: springs to draw, such as Springs("gaussian"); by default none.
            ax: axes of matplotlib to draw in; by default those of a new figure.

        Returns the axes. Raises ModelError if the model does not fit the problem.

        Example:
            >>> axes = problem.plot(ts.Springs("gaussian"))
        """
        from truespring.showing.problems import plot_problem

        return plot_problem(self, model, ax)

    @property
    def mass(self) -> Floats:
        """The lumped mass of the nodes [kg], shape (n_nodes,): each has its share of the elements around it.

        Raises ProblemError without a density.
        """
        return self.mass_on(self.body)

    @property
    def crossing_time(self) -> float | None:
        """The time in which a longitudinal wave crosses the smallest element [s]; None without material and density."""
        if self.body.density is None or self.mesh.element == "line":
            return None
        stiffness = self.of_elements(lambda material: material.lame.lam + 2 * material.lame.mu)
        sizes = np.abs(element_corner_measures(self.mesh).sum(axis=1)) ** (1 / self.mesh.dim)
        return float((sizes * np.sqrt(self.body.density / stiffness)).min())

    def mass_on(self, body: Body) -> Floats:
        """Return the lumped mass of the nodes of `body`, which may have mid-edge nodes [kg], shape (n_nodes,)."""
        if body.density is None:
            raise ProblemError("a mass needs a density [kg/m^3] of the material and of each region")
        return nodal_mass(body, body.density)

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """The distinct materials of the elements: that of the body first, then those of the regions."""
        return tuple(self._materials[0])

    @cached_property
    def material_numbers(self) -> Ints:
        """Index in `materials` of the material of each element, shape (n_elements,)."""
        return self._materials[1]

    @cached_property
    def _materials(self) -> tuple[list[Material], Ints]:
        """Distinct materials, and the index of the material of each element."""
        if self.material is None:
            return [], np.zeros(len(self.mesh.elements), dtype=np.int64)
        named = list(dict.fromkeys([self.material, *(region.material for region in self.regions)]))
        numbers = np.zeros(len(self.mesh.elements), dtype=np.int64)
        for region in self.regions:
            numbers[select_elements(self.mesh, region.on)] = named.index(region.material)
        used = np.bincount(numbers, minlength=len(named)) > 0
        return [material for material, there in zip(named, used, strict=True) if there], (np.cumsum(used) - 1)[numbers]

    @cached_property
    def fibres(self) -> Families | None:
        """The fibres of the elements; None if no material has any. Raises FibreError if a direction is wrong."""
        return families(self.mesh, [material.fibres for material in self.materials], self.material_numbers)

    @cached_property
    def homogeneous(self) -> "tuple[Problem, ...]":
        """For each of `materials` the problem with the whole body of that material, without fibres."""
        if not self.regions:
            return (self.without_fibres,)
        plain = self.without_fibres
        alone = [one if one.fibres is None else replace(one, fibres=None) for one in self.materials]
        return tuple(replace(plain, material=material, regions=()) for material in alone)

    @cached_property
    def without_fibres(self) -> "Problem":
        """The body without fibres, and without supports and loads, which may act along them; `self` if it has none."""
        if self.fibres is None or self.material is None:
            return self
        plain = replace(self, supports=(), loads=(), stated=False)
        return plain.with_materials(lambda material: replace(material, fibres=None))

    def with_materials(self, change: Callable[[Material], Material]) -> "Problem":
        """Return the problem with each material changed: that of the body, and those of its regions."""
        if self.material is None:
            return self
        regions = [replace(region, material=change(region.material)) for region in self.regions]
        return replace(self, material=change(self.material), regions=regions)

    @property
    def dense(self) -> "Problem":
        """The problem with the density of water for materials without one."""
        return self.with_materials(lambda material: replace(material, density=material.density or WATER))

    @cached_property
    def blocks(self) -> "tuple[tuple[Ints, Problem], ...]":
        """For each kind of elements their numbers, shape (n,), and a problem of them without supports and loads."""
        if self.mesh.element != MIXED:
            return ((np.arange(len(self.mesh.elements)), self),)
        return tuple((numbers, self._on(part, numbers)) for numbers, part in self.mesh.blocks)

    def part(self, numbers: Ints, nodes: Ints) -> "Problem":
        """Return a problem of some elements without supports and loads; `numbers` and `nodes` as in `Mesh.part`."""
        return self._on(self.mesh.part(numbers, nodes), numbers)

    def _on(self, part: Mesh, numbers: Ints) -> "Problem":
        """Return a problem without supports and loads on a mesh of the elements `numbers`, shape (n,)."""
        regions = _regions_of(self, self.material_numbers[numbers])
        return replace(self, mesh=part, supports=(), loads=(), regions=regions, stated=False)

    def of_elements(self, value: Callable[[Material], float]) -> Floats:
        """Return `value` of the material of each element, shape (n_elements,), in the unit of `value`."""
        return np.array([value(material) for material in self.materials])[self.material_numbers]

    @cached_property
    def loading(self) -> Loading:
        """Forces, held directions and prescribed displacements."""
        shape = self.mesh.nodes.shape
        held, moved, histories = np.zeros(shape, dtype=bool), np.zeros(shape), np.zeros(shape, dtype=np.int64)
        displacements = np.zeros((len(self._histories), *shape))
        for support, stated in zip(self.held, self.supports, strict=True):
            motion = np.tile(support.motion, (len(support.nodes), 1))
            if support.turn is not None:
                motion = motion + support.turn.motion(1.0)
            number = self._histories.index(_history(stated))
            for axis in support.directions:
                there = (support.nodes, axis)
                self._check_one_motion(*there, held, moved, motion[:, axis], histories != number)
                held[there], moved[there], histories[there] = True, motion[:, axis], number
                displacements[:, support.nodes, axis] = 0.0
                displacements[number, support.nodes, axis] = support.motion[axis]
        for support, stated in reversed(list(zip(self.held, self.supports, strict=True))):
            if support.turn is not None:  # the first that turns a node moves it, see `Loading.motion`
                displacements[:, support.nodes] = 0.0
                displacements[self._histories.index(_history(stated)), support.nodes] = support.motion
        turns = [
            tuple(
                one.turn
                for one, stated in zip(self.held, self.supports, strict=True)
                if one.turn is not None and _history(stated) == history
            )
            for history in self._histories
        ]
        return self.loading_on(self.body, held, displacements, turns)

    def loading_on(self, body: Body, held: Bools, displacements: Floats, turns: Sequence[tuple[Turn, ...]]) -> Loading:
        """Return the loads on `body`, which may have mid-edge nodes, with prescribed motion.

        Args:
            body: the body.
            held: true where a displacement is prescribed, shape (n_nodes, dim).
            displacements: prescribed displacement of each part of the loading [m], shape (n_parts, n_nodes, dim).
            turns: prescribed rotations of each part of the loading.
        """
        parts = []
        for history, displacement, turned in zip(self._histories, displacements, turns, strict=True):
            loads = [number for number, load in enumerate(self.loads) if _history(load) == history]
            amplitude = self._amplitude(history)
            force = nodal_force(self._of_each_load(lambda load: load.spread(body), loads), held.shape)
            following = tuple(self._of_each_load(lambda load: load.following(body, held), loads))
            parts.append(Loading(force, held, displacement, turned, following, amplitude))
        _check_names(self.touching)
        acting = tuple(one.acting_on(body, self._young, self.duration or 1.0) for one in self.touching)
        return replace(parts[0], further=tuple(parts[1:]), interactions=acting)

    @property
    def touching(self) -> tuple[Tool | Grasp, ...]:
        """The tools, then the grasps."""
        return (*self.tools, *self.grasps)

    @cached_property
    def _histories(self) -> tuple[Rows | None, ...]:
        """The distinct histories of loads and supports; that without a table first."""
        return tuple(dict.fromkeys([None, *map(_history, self.loads), *map(_history, self.supports)]))

    def share_of_support(self, number: int, level: float) -> float:
        """Return the share of the prescribed motion of a support, counted from 0, at a level [-]."""
        return self._amplitude(_history(self.supports[number])).at(level)

    @property
    def duration(self) -> float | None:
        """The duration of the motion [s], None at rest."""
        return None if self.dynamics is None else self.dynamics.duration

    def where(self, level: float) -> str:
        """Return a level in words, for messages: "load factor 0.4", in a motion "0.16 s"."""
        return f"load factor {level:.6g}" if self.duration is None else f"{level * self.duration:.6g} s"

    @property
    def returns(self) -> bool:
        """Whether displacements or forces may vanish on the way: in a motion, with histories, with moving tools.

        A tool or grasp counts if its place changes: before it touches, and after it retracts, it moves nothing. So it
        does if it acts in a part of the way only.
        """
        histories = any(history is not None for history in self._histories)
        acting = any(varies(one.path) or one.during is not None for one in self.touching)
        return self.dynamics is not None or histories or acting

    @property
    def _young(self) -> float | None:
        """The largest Young's modulus of the materials [Pa], None without a material."""
        return max((material.young for material in self.materials), default=None)

    @cached_property
    def held(self) -> tuple[Held, ...]:
        """The nodes and directions that each support holds."""
        return tuple(held_by(self.mesh, support) for support in self.supports)

    @cached_property
    def body(self) -> Body:
        """The body that loads act on."""
        dense = bool(self.materials) and all(material.density is not None for material in self.materials)
        density = self.of_elements(lambda material: material.density or 0.0) if dense else None
        along = None if self.fibres is None else self.fibres.directions
        thickness = 1.0 if self.section is None else self.section.thickness
        return Body(self.mesh, thickness, density, along, moving=self.dynamics is not None)

    def _amplitude(self, history: Rows | None) -> Amplitude:
        """Return the amplitude of a history; raise PartError with the first load or support that has it."""
        try:
            return amplitude_of(history, self.duration)
        except ProblemError as error:
            several: dict[str, Sequence[Load | Fixed]] = {"load": self.loads, "support": self.supports}
            place = next(
                (kind, number, "over")
                for kind, ones in several.items()
                for number, one in enumerate(ones)
                if _history(one) == history
            )
            raise PartError(place, str(error).removeprefix("over: ")) from None

    def _of_each_load(self, ask: Callable[[Load], _Found | None], numbers: Sequence[int]) -> Iterator[_Found]:
        """Yield `ask(load)` for loads, except None; raise LoadError with the number of a load that raises."""
        for number in numbers:
            try:
                found = ask(self.loads[number])
            except TruespringError as error:
                raise LoadError(number, str(error)) from None
            if found is not None:
                yield found

    @property
    def rims(self) -> Ints:
        """Edges of loaded surfaces that loads in 3D need held, as node numbers, shape (n, 2)."""
        return np.concatenate([np.zeros((0, 2), dtype=np.int64), *(load.rim(self.mesh) for load in self.loads)])

    def scaled(self, factor: float) -> "Problem":
        """Return the problem with all loads and prescribed motions multiplied by a factor."""
        loads = [load.scaled(factor) for load in self.loads]
        return replace(self, loads=loads, supports=[support.scaled(factor) for support in self.supports])

    def _check_one_motion(
        self, nodes: Ints, axis: int, held: Bools, moved: Floats, motion: Floats, otherwise: Bools
    ) -> None:
        """Raise ProblemError if an earlier support prescribes another motion [m] of the nodes along an axis.

        `otherwise` is true where the earlier support has another history, shape (n_nodes, dim).
        """
        another = (moved[nodes, axis] != motion) | (otherwise[nodes, axis] & (motion != 0))
        clash = np.flatnonzero(held[nodes, axis] & another)
        if clash.size:
            first = int(clash[0])
            raise ProblemError(
                f"two supports move node {nodes[first]} along {AXES[axis]} by {moved[nodes[first], axis]:g} m and by "
                f"{motion[first]:g} m: a node has one prescribed motion"
            )

    def _check_rigid_motion(self) -> None:
        """Raise ProblemError if supports and grasps do not prevent a rigid-body motion.

        No unique equilibrium would exist.
        """
        parts, held = self.mesh.parts, self.loading.held.copy()
        for grasp in self.loading.interactions[len(self.tools) :]:
            if grasp.switches:  # it does not hold the body on the whole way
                continue
            held[grasp.largest_stiffness()[: len(held)] > 0] = True
        by_part = np.argsort(parts, kind="stable")
        several = np.split(by_part, np.flatnonzero(np.diff(parts[by_part])) + 1)
        for nodes in several:
            free = _rigid_freedom(self.mesh.nodes[nodes], held[nodes])
            if free is None:
                continue
            body = "the body"
            if len(several) > 1:
                place = ", ".join(f"{coordinate:.6g}" for coordinate in self.mesh.nodes[nodes].mean(axis=0))
                body = f"one of {len(several)} disconnected parts ({len(nodes)} nodes about ({place}) m)"
            raise ProblemError(
                f"the supports leave {body} free to move {free} as a rigid body: hold more directions or more nodes"
            )


def sample(problem: Problem, elements: Ints) -> Problem:
    """Return a problem of some elements that share no nodes; arbitrary supports make it valid."""
    mesh, numbers = problem.mesh, problem.material_numbers[elements]
    nodes = np.arange(mesh.kind.n_nodes * len(elements))
    corners = mesh.elements[elements]
    return replace(
        problem,
        mesh=Mesh(
            mesh.nodes[corners.ravel()],
            nodes.reshape(corners.shape),
            mesh.element,
            element_vectors=mesh.vectors_of(elements),
        ),
        supports=[Fixed(on=nodes, displacement=(1.0,) * mesh.dim)],  # type: ignore[arg-type]
        loads=(),
        tools=(),
        grasps=(),
        dynamics=None,
        regions=_regions_of(problem, numbers),
    )


def _regions_of(problem: Problem, numbers: Ints) -> list[Region]:
    """Return a region for each material, where `numbers` has the material of each element, shape (n_elements,)."""
    return [
        Region(np.flatnonzero(numbers == number), material)  # type: ignore[arg-type]
        for number, material in enumerate(problem.materials)
        if (numbers == number).any() and len(problem.materials) > 1
    ]


def _rigid_freedom(nodes: Floats, held: Bools) -> str | None:
    """Return a rigid-body motion of `nodes` [m] that the `held` directions do not prevent, None if there is none.

    Both arrays have shape (n, dim). The result ends "free to move ...": "along y" or "by turning".
    """
    if held.all():
        return None
    tolerance = 1e-9 * np.sqrt(nodes.size)  # a rotation about a line does not move its nodes
    rank = _rigid_rank(nodes, held, tolerance)
    if rank == n_modes(nodes.shape[1]) or 0 < rank == _rigid_rank(nodes, np.ones_like(held), tolerance):
        return None
    free = [axis for axis, there in zip(AXES, held.T, strict=False) if not there.any()]
    return f"along {', '.join(free)}" if free else "by turning"


def _rigid_rank(nodes: Floats, held: Bools, tolerance: float) -> int:
    """Return the rank of the rigid-body modes of `nodes` [m] in the `held` directions: singular values > tolerance."""
    places = centred(nodes)
    upper = np.zeros((0, n_modes(nodes.shape[1])))
    for part in slices(len(nodes), 8 * nodes.shape[1] * upper.shape[1]):
        if held[part].any():
            modes = modes_at(places[part])[held[part].ravel()]
            upper = np.asarray(np.linalg.qr(np.concatenate([upper, modes]), mode="r"))
    return int((np.linalg.svd(upper, compute_uv=False) > tolerance).sum())


def _several(value: object, kind: type, name: str, allowed: str) -> tuple[Any, ...]:
    """Return one instance of a class or a sequence of them as a tuple; raise ProblemError for anything else."""
    several = (value,) if isinstance(value, kind) else value
    if not isinstance(several, Sequence) or not all(isinstance(one, kind) for one in several):
        raise ProblemError(f"{name} = {value!r}: must be a list of {allowed}")
    return tuple(several)


def _check_names(several: Sequence[Tool | Grasp]) -> None:
    """Raise ToolError if two tools or grasps have one name."""
    seen: set[str] = set()
    for one in several:
        if one.name in seen:
            raise ToolError(one.name, "is the name of two tools or grasps, which tables list by name", "name")
        seen.add(one.name)


def _history(one: Load | Fixed) -> Rows | None:
    """Return the history of a load or support as tuples, None without one."""
    return None if one.over is None else tuple(tuple(map(float, row)) for row in one.over)


_TOOLS = " or ".join(tool.__name__ for tool in TOOLS.values())
_LOADS = " or ".join(kind.load.__name__ for kind in LOADS.values())
