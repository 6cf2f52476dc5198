"""What every target is given: the problem, the springs, and the equilibrium that the receiver should find."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version

import numpy as np

from truespring.arrays import Bools, Floats
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
    """A spring model that was solved, to be carried to another simulator.

    Attributes:
        title: of the study.
        problem: mesh, material, supports and loads.
        path: the springs' equilibria up to full load; `path.potential` is what was solved, and HasSprings.
        probe: number of the node that is watched.
        load_steps: load levels that the study asks for.
        remarks: what else the reader of the file should know, in sentences.
        note: what the study says of itself at its head, such as how its springs were found; empty for nothing.
    """

    title: str
    problem: Problem
    path: Solution
    probe: int
    load_steps: int
    remarks: tuple[str, ...] = ()
    note: str = ""

    @cached_property
    def state(self) -> State | None:
        """Our equilibrium at full load, None where it was not reached."""
        found = self.path.at(1.0)
        return found if found is not None and found.load_factor == 1.0 else None

    @cached_property
    def springs(self) -> SpringData:
        """The springs and what they have beside."""
        return spring_data(self.path.potential)

    @property
    def network(self) -> PlainSprings:
        """The springs alone; of a target that takes no coupled springs."""
        assert self.springs.network is not None  # refused before
        return self.springs.network

    @property
    def held(self) -> Bools:
        """True where the displacement is prescribed, shape (n_nodes, dim)."""
        return self.problem.loading.held

    @cached_property
    def motion(self) -> Floats:
        """The prescribed displacement at full load [m], zero where free, shape (n_nodes, dim)."""
        return self.problem.loading.motion()

    @cached_property
    def external_force(self) -> Floats:
        """Force on the nodes at full load [N], shape (n_nodes, dim), weights and loads that follow the body included.

        Loads that follow the body are dead forces here: those on the body at our equilibrium, which is
        then one of theirs. Raises ExportError where there are such loads and full load was not reached.
        """
        loading = self.problem.loading
        if not loading.following:
            return loading.external_force
        if self.state is None:
            raise ExportError(
                "a load that follows the body is carried over as its forces at full load, which was not reached "
                f"(load factor {self.path.load_factor:.6g}): load less, or take more load_steps"
            )
        return loading.force(self.state.positions)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a receiver sees otherwise than it was asked here, in sentences."""
        return (*self.remarks, *self._notes())

    def _notes(self) -> Iterator[str]:
        if self.problem.loading.following:
            yield (
                "A load that follows the body is a dead force here, as it acts at our equilibrium at full load: "
                "the equilibrium is the same, its stability and the way there are not."
            )
        if self.problem.loading.turns:
            yield "Nodes that a support turns stand at their turned places."

    @cached_property
    def header(self) -> tuple[str, ...]:
        """Title, units, material, supports, loads and what to expect, a sentence a line, for the head of a file."""
        return printable(
            [
                self.title,
                self.written,
                *([self.note] if self.note else []),
                "Units are SI: m, N, N/m, kg, s.",
                *self.asked,
                "Loads and prescribed motions stand at their full values.",
                *self.told_of_springs,
            ]
        )

    @property
    def written(self) -> str:
        """What the springs are, and who wrote them."""
        return f"{self.path.label}, written by truespring {version('truespring')}."

    @property
    def asked(self) -> tuple[str, ...]:
        """Mesh, material, section, supports and loads, a sentence a line."""
        return printable(self._asked())

    @property
    def told_of_springs(self) -> tuple[str, ...]:
        """How springs bear weight, what to expect of them, and what is to be known, a sentence a line."""
        everywhere = [load.words() for load in self.problem.loads if load.on is None]
        weight = [f"{words[:1].upper()}{words[1:]} acts as forces on nodes." for words in everywhere]
        return printable([*weight, *self.expected, *self.notes])

    def _asked(self) -> Iterator[str]:
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
        """How the body carries the direction that its mesh does not have: "plane stress", "plane strain", or ""."""
        return "" if self.problem.section is None else self.problem.section.words

    @property
    def expected(self) -> tuple[str, ...]:
        """What our equilibrium at full load is, and what is to be known of it, in sentences."""
        return tuple(self._expected())

    def _expected(self) -> Iterator[str]:
        if self.state is None:
            yield (
                f"Expect nothing: full load was not reached here ({self.path.status}), "
                f"the last equilibrium has load factor {self.path.load_factor:.6g}."
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
                yield f"Another program need not find that state: the path to it is {self.path.status}."
        yield from (f"Warning of truespring: {warning}." for warning in self.path.warnings)


def spring_data(potential: object) -> SpringData:
    """Return the springs of a potential; raise ExportError where it has none."""
    if not isinstance(potential, HasSprings):
        raise ExportError(f"{type(potential).__name__} is no model of springs: use Springs(rule=...) or SpringNetwork")
    return potential.spring_data()


def solve_springs(
    problem: Problem,
    model: Model,
    solver: Solver | None = None,
    title: str = "Springs",
    probe: int | None = None,
    report: Reporter | None = None,
) -> Exported:
    """Solve springs up to full load, so that a file can tell what to expect of them.

    A solver that follows displacements or the arc's length is replaced by Newton with as many load steps: other
    programs put the load on. `probe` is by default the free node that moves most.
    """
    chosen, remarks = Newton() if solver is None else as_solver(solver), []
    steps = chosen.load_steps
    if not chosen.follows_load:
        chosen = Newton(load_steps=steps)
        remarks = ["The load is taken up in steps here, not followed past limit points as it was asked."]
    path = solve(problem, model, chosen, report)
    if probe is None:
        told = problem.loading.held.all(axis=1)  # such a node's motion tells nothing of the springs
        moved = np.linalg.norm(path.states[-1].displacement, axis=1)
        probe = int(np.where(told & ~told.all(), -1.0, moved).argmax())
    return Exported(title, problem, path, probe, steps, tuple(remarks))


def printable(sentences: Iterable[str]) -> tuple[str, ...]:
    """Return sentences of a line each: whatever a title holds, it does not end the comment that it stands in."""
    signs = ("".join(sign if sign.isprintable() else " " for sign in sentence) for sentence in sentences)
    return tuple(" ".join(sentence.split()) for sentence in signs)
