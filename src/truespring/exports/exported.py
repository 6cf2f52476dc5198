"""The input of every export target: the problem, the springs, and the expected equilibrium."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.conditions import Loading, Refined
from truespring.equilibrium import Solution, State, Status, solve
from truespring.errors import ExportError
from truespring.loading import vector_words
from truespring.mesh import counted
from truespring.models import Model
from truespring.models.spring_data import HasSprings, PlainSprings, SpringData
from truespring.problem import Problem
from truespring.solvers import Newton, Reporter, Solver, as_solver


@dataclass(frozen=True, eq=False)
class Exported:
    """A solved spring model to be exported.

    Attributes:
        title: title of the study.
        problem: mesh, material, supports and loads.
        path: the equilibria up to full load; `path.potential` implements HasSprings.
        probe: number of the probe node.
        load_steps: number of load levels.
        remarks: further sentences for the header of the files.
        note: the study's note, such as how its springs were calibrated; empty if there is none.
        options: values of the target's options by name.
    """

    title: str
    problem: Problem
    path: Solution
    probe: int
    load_steps: int
    remarks: tuple[str, ...] = ()
    note: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def state(self) -> State | None:
        """The equilibrium at full load, None if it was not reached."""
        found = self.path.at(1.0)
        return found if found is not None and found.load_factor == 1.0 else None

    @cached_property
    def springs(self) -> SpringData:
        """The springs with their volume term or coupling."""
        return spring_data(self.path.potential)

    @property
    def network(self) -> PlainSprings:
        """The springs alone; only for targets that do not support coupled springs."""
        assert self.springs.network is not None  # check_targets raises for these
        return self.springs.network

    @property
    def refined(self) -> Refined | None:
        """The potential, if it has further nodes after those of the mesh; else None."""
        return self.path.potential if isinstance(self.path.potential, Refined) else None

    @property
    def nodes(self) -> Floats:
        """Undeformed positions of all nodes of the springs [m], shape (n_nodes, dim)."""
        assert self.path.potential is not None  # it was solved here
        return self.path.potential.nodes

    @property
    def held(self) -> Bools:
        """True where the displacement is prescribed, shape (n_nodes, dim)."""
        return self.problem.loading.held

    @cached_property
    def motion(self) -> Floats:
        """The prescribed displacement at full load [m], zero where free, shape (n_nodes, dim)."""
        return self.problem.loading.full.motion()

    @cached_property
    def external_force(self) -> Floats:
        """Nodal forces at full load [N], shape (n_nodes, dim), with gravity and loads that follow the body.

        Loads that follow the body are evaluated at the equilibrium at full load: as dead forces they have the same
        equilibrium. Raises ExportError if there are such loads and full load was not reached.
        """
        return self.force_of(self.problem.loading)

    def force_of(self, loading: Loading) -> Floats:
        """Return the nodal forces of a loading at full load, as `external_force` [N], shape (n, dim)."""
        if not loading.follows:
            return loading.dead_force()
        if self.state is None:
            raise ExportError(
                "a load that follows the body is exported as its forces at full load, which was not reached "
                f"(load factor {self.path.load_factor:.6g}): reduce the load or use more load_steps"
            )
        return loading.loads(self.state.all_positions[: len(loading.held)])

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what differs from the problem in the exported model."""
        return (*self.remarks, *self._notes())

    def _notes(self) -> Iterator[str]:
        if self.problem.loading.follows:
            yield (
                "A load that follows the body is exported as the dead forces that act at the equilibrium at full load: "
                "the equilibrium is the same, its stability and the path to it are not."
            )
        if any(part.turns for part in self.problem.loading.parts):
            yield "Nodes that a support rotates are at their rotated positions."

    @cached_property
    def header(self) -> tuple[str, ...]:
        """The header of a file: title, units, material, supports, loads and expected result, one sentence per line."""
        return printable(
            [
                self.title,
                self.written,
                *([self.note] if self.note else []),
                "Units are SI: m, N, N/m, kg, s.",
                *self.stated,
                "Loads and prescribed displacements are those at full load.",
                *self.expectations,
            ]
        )

    @property
    def written(self) -> str:
        """The model and the version that wrote it, as a sentence."""
        return f"{self.path.label}, written by truespring {version('truespring')}."

    @property
    def stated(self) -> tuple[str, ...]:
        """Mesh, material, section, supports and loads, one sentence each."""
        return printable(self._stated())

    @property
    def expectations(self) -> tuple[str, ...]:
        """How body loads act on springs, the expected result, and notes, one sentence each."""
        everywhere = [load.words() for load in self.problem.loads if load.on is None]
        weight = [f"{words[:1].upper()}{words[1:]} acts as nodal forces." for words in everywhere]
        return printable([*weight, *self.expected, *self.notes])

    def _stated(self) -> Iterator[str]:
        mesh = self.problem.mesh
        yield f"{mesh.n_nodes} nodes, {len(mesh.elements)} elements: {mesh.kinds}."
        yield from self._body()
        for number, (support, held) in enumerate(zip(self.problem.supports, self.problem.held, strict=True), 1):
            yield f"Support {number}: {support.words(mesh.dim)} ({counted(len(held.nodes), 'node')})."
        for number, load in enumerate(self.problem.loads, 1):
            yield f"Load {number}: {load.words()}."

    def _body(self) -> Iterator[str]:
        for number, material in enumerate(self.problem.materials):
            count = int((self.problem.material_numbers == number).sum())
            of = f" of {counted(count, 'element')}" if self.problem.regions else ""
            density = "density not given" if material.density is None else f"density {material.density:g} kg/m^3"
            yield (
                f"Material{of}: Young's modulus {material.young:g} Pa, Poisson's ratio {material.poisson:g}, {density}."
            )
        if self.problem.section is not None and self.problem.section.key:
            yield f"Section: {self.section}, thickness {self.problem.section.thickness:g} m."

    @property
    def section(self) -> str:
        """The section of a plane body: "plane stress" or "plane strain"; "" in 3D."""
        return "" if self.problem.section is None else self.problem.section.words

    @property
    def expected(self) -> tuple[str, ...]:
        """Sentences on the equilibrium at full load, and the warnings of the solution."""
        return tuple(self._expected())

    @property
    def expectation(self) -> dict[str, Any]:
        """The equilibrium to expect at full load, as JSON values in SI units; None where it was not reached.

        Displacement of the probe and the largest one [m], force of the loads and of the supports on the body [N], and
        elastic energy [J].
        """
        state, mesh = self.state, self.problem.mesh
        known = {
            "model": self.path.label,
            "truespring": version("truespring"),
            "status": str(self.path.status),
            "load_factor": self.path.load_factor,
            "probe": {"node": self.probe, "position": mesh.nodes[self.probe].tolist()},
            "expected": None,
            "warnings": list(self.path.warnings),
            "notes": list(self.notes),
        }
        if state is None:
            return known
        expected = {
            "probe_displacement": state.displacement[self.probe].tolist(),
            "largest_displacement": float(np.linalg.norm(state.displacement, axis=1).max()),
            "applied_force": state.applied_force.tolist(),
            "support_force": state.reaction.sum(axis=0).tolist(),
            "energy": state.energy,
        }
        return known | {"expected": expected}

    def _expected(self) -> Iterator[str]:
        if self.state is None:
            yield (
                f"No expected result: full load was not reached ({self.path.status}), "
                f"the last equilibrium is at load factor {self.path.load_factor:.6g}."
            )
        else:
            moved = self.state.displacement
            yield (
                f"Expected at full load: node {self.probe}, counted from 0, at rest at "
                f"{vector_words(self.problem.mesh.nodes[self.probe], 9)} m, has moved by "
                f"{vector_words(moved[self.probe], 9)} m; the largest displacement is "
                f"{np.linalg.norm(moved, axis=1).max():.9g} m."
            )
            if self.path.status is not Status.CONVERGED:
                yield f"Another program may find another state: the path to this one is {self.path.status}."
        yield from (f"Warning by truespring: {warning}." for warning in self.path.warnings)


def spring_data(potential: object) -> SpringData:
    """Return the springs of a potential; raise ExportError if it has none."""
    if not isinstance(potential, HasSprings):
        raise ExportError(f"{type(potential).__name__} is not a spring model: use Springs(rule=...) or SpringNetwork")
    return potential.spring_data()


def solve_springs(
    problem: Problem,
    model: Model,
    solver: Solver | None = None,
    title: str = "Springs",
    probe: int | None = None,
    report: Reporter | None = None,
) -> Exported:
    """Solve a spring model up to full load, so that files can state the expected result.

    Displacement control and arc length are replaced by Newton with as many load steps, because other programs apply
    the load in steps. `probe` is by default the free node that moves most.
    """
    chosen, remarks = Newton() if solver is None else as_solver(solver), []
    steps = chosen.load_steps
    if not chosen.follows_load:
        chosen = Newton(load_steps=steps)
        remarks = ["The load is applied in steps; the study follows the path beyond limit points instead."]
    path = solve(problem, model, chosen, report)
    if probe is None:
        held = problem.loading.held.all(axis=1)  # the displacement of such a node is prescribed
        moved = np.linalg.norm(path.states[-1].displacement, axis=1)
        probe = int(np.where(held & ~held.all(), -1.0, moved).argmax())
    return Exported(title, problem, path, probe, steps, tuple(remarks))


def printable(sentences: Iterable[str]) -> tuple[str, ...]:
    """Return each sentence as one line of printable characters, so that a title cannot end the comment it is in."""
    signs = ("".join(sign if sign.isprintable() else " " for sign in sentence) for sentence in sentences)
    return tuple(" ".join(sentence.split()) for sentence in signs)
