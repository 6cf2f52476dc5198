"""CalculiX as a model: write the deck of a problem, run ccx, and read its results as a solution."""

import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import on_the_mesh
from truespring.equilibrium import Solution, State, Status
from truespring.errors import ModelError, ReferenceFileError
from truespring.exports.calculix import FORCE_UNIT, LAWS, fem_deck, spring_deck
from truespring.exports.continuum import check_fem, fem_element, second_order, usual_element
from truespring.exports.exported import spring_data
from truespring.exports.features import refuse_others
from truespring.exports.spring_elements import SPRINGA, is_led_aside
from truespring.loading import FacePressure
from truespring.models import Fem, Model
from truespring.models.quadratic import QuadraticPotential
from truespring.models.spring_data import PlainSprings
from truespring.problem import Problem
from truespring.program import Program
from truespring.reference.ccx import Effort, Finished, find_ccx, run_ccx
from truespring.reference.dat import read_dat
from truespring.reference.record import Level
from truespring.reference.scan import scanning
from truespring.solvers import Reporter, Solver


@dataclass(frozen=True)
class CalculiX(Program):
    """A model solved by CalculiX: finite elements, or a spring model as SPRINGA elements.

    Attributes:
        law: "linear", or "saint-venant-kirchhoff" (NLGEOM), the default; None for springs.
        springs: a spring model or network instead of a continuum.
        element: "linear", or "quadratic" for triangles and tetrahedra, where it is the default; not for springs.

    Example:
        >>> import truespring as ts
        >>> ts.CalculiX(law="saint-venant-kirchhoff").label  # ts.solve(problem, model) runs the program ccx
        'CalculiX'
    """

    law: str | None = None
    springs: Model | None = None
    element: str | None = None

    kind = "calculix"

    def __post_init__(self) -> None:
        if self.springs is not None:
            object.__setattr__(self, "law", None)
        elif self.law is None:
            object.__setattr__(self, "law", "saint-venant-kirchhoff")
        elif self.law not in LAWS:
            raise ModelError(f"law = '{self.law}' is not available in CalculiX; allowed: {', '.join(LAWS)}")

    def label_on(self, problem: Problem) -> str:
        """Return the label, with the element types."""
        if self.springs is not None:
            return "CalculiX SPRINGA NLGEOM"
        return f"CalculiX {fem_element(problem, self._element(problem))} {'NLGEOM' if self.finite else 'linear'}"

    @property
    def _law(self) -> str:
        """The law of the elements."""
        return str(self.law)

    def _element(self, problem: Problem) -> str:
        return self.element or usual_element(problem)

    def _finer(self, problem: Problem) -> QuadraticPotential | None:
        """Return the second-order potential whose nodes are those of the deck; None for first-order elements."""
        return None if self.springs is not None else second_order(problem, self._element(problem))

    @property
    def finite(self) -> bool:
        """Whether the model has finite strain: False for the linear law."""
        return self.springs is not None or self.law != "linear"

    @property
    def element_is_open(self) -> bool:
        """Whether the element is chosen by the mesh."""
        return self.springs is None and self.element is None

    def second_order(self, problem: Problem) -> Fem | None:
        """Return second-order finite elements of the same law, which have the same limit; None for other models."""
        first = self.springs is None and self._element(problem) == "linear"
        return Fem(self._law) if first else None

    def check_run(self, problem: Problem, solver: Solver) -> None:
        """Raise ModelError without ccx or load control, ExportError if CalculiX does not support the problem."""
        if not solver.follows_load:
            raise ModelError('CalculiX supports only control = "load": change it, or remove this model')
        find_ccx()
        if self._network(problem) is None:
            check_fem(problem, self._law, self._element(problem))

    def _network(self, problem: Problem) -> PlainSprings | None:
        """Return the springs, None for a continuum; raise ExportError if SPRINGA elements do not support them."""
        if self.springs is None:
            return None
        springs = spring_data(self.springs.potential(problem))
        refuse_others(problem, springs, SPRINGA, "CalculiX SPRINGA")
        return springs.network

    def run(
        self, problem: Problem, solver: Solver, report: Reporter | None = None, timeout: float | None = None
    ) -> Solution:
        """Run ccx in a temporary folder and return the states reached, the undeformed one first.

        If a run does not converge, or takes longer than `timeout` [s], by default one hour, the solution ends at the
        last level reached. Raises ModelError and ExportError as `check_run` does.
        """
        self.check_run(problem, solver)
        levels = [(number + 1) / solver.load_steps for number in range(solver.load_steps)]
        network = self._network(problem)
        if network is None:
            deck = fem_deck(problem, levels, self._law, self._element(problem))
        else:
            deck = spring_deck(problem, network, levels)
        finer = self._finer(problem)
        nodes = problem.mesh.nodes if finer is None else finer.nodes
        before = int(network is not None and is_led_aside(problem, network))  # steps that are not load levels

        def reached(step: int, share: float) -> None:
            place = step - before - 1
            if report and place >= 0:
                last = levels[place - 1] if place else 0.0
                report(last + share * (levels[place] - last), 0, math.nan)

        with tempfile.TemporaryDirectory(prefix="truespring-") as folder:
            file = Path(folder) / "model.inp"
            file.write_text(deck, encoding="utf-8")
            finished = run_ccx(file, reached=reached, timeout=timeout)
            try:
                found = _results(file.with_suffix(".dat"), len(nodes))
            except ReferenceFileError as error:  # ccx was terminated while writing
                found, finished = [], replace(finished, errors=(*finished.errors, str(error)))
        still = np.zeros((len(nodes), 3))
        states = [self._state(problem, 0.0, Level(0.0, still, 0.0), still, None, network, finer)]
        for place, (load_factor, (level, force)) in enumerate(zip(levels, found, strict=False)):
            effort = finished.efforts.get(place + before + 1)
            states.append(self._state(problem, load_factor, level, force, effort, network, finer))
        return self._path(problem, states, levels, finished, finer)

    def _path(
        self,
        problem: Problem,
        states: list[State],
        levels: list[float],
        finished: Finished,
        finer: QuadraticPotential | None,
    ) -> Solution:
        status, warnings = Status.CONVERGED, []
        if any(state.area_ratio <= 0 for state in states) and self.finite:
            status = Status.INVERTED
            first = next(state for state in states if state.area_ratio <= 0)
            warnings.append(
                f"inverted from load factor {first.load_factor:.6g} (smallest ratio "
                f"{min(state.area_ratio for state in states):.3g}): {status.advice}"
            )
        if len(states) <= len(levels) or finished.code:
            status = Status.NOT_CONVERGED
            missed = levels[min(len(states), len(levels)) - 1]
            warnings.insert(
                0,
                f"load factor {missed:.6g} was not reached; last good load factor: {states[-1].load_factor:.6g}; "
                f"message of CalculiX: {_message(finished)}; {status.advice}. `truespring export` writes the deck",
            )
        unknown = [state.load_factor for state in states if math.isnan(state.energy)]
        if unknown:
            warnings.append(
                f"the stored energy is not known at load factor {unknown[0]:.6g}: CalculiX prints only that of the "
                "last increment, and used several for this level"
            )
        cards = [card for load in problem.loads for card in load.cards(problem.mesh)]
        pressed = any(isinstance(card, FacePressure) for card in cards)
        if pressed and problem.section is not None and problem.section.free_thickness and self.finite:
            warnings.append(
                "in CalculiX the pressure acts on the deformed thickness, in truespring on the undeformed one; in "
                "plane strain there is no difference"
            )
        warnings.append("stability not proven: CalculiX does not report it")
        return Solution(
            problem=problem,
            label=self.label_on(problem),
            kind=self.kind,
            finite=self.finite,
            lines=self.lines,
            states=tuple(states),
            status=status,
            warnings=tuple(warnings),
            seconds=finished.seconds,
            grid=None if finer is None else finer.grid,
            n_unknowns=int((~(problem if finer is None else finer).loading.held).sum()),
        )

    def _state(
        self,
        problem: Problem,
        load_factor: float,
        level: Level,
        internal: Floats,
        effort: Effort | None,
        network: PlainSprings | None,
        finer: QuadraticPotential | None,
    ) -> State:
        """Return the state of a level; `internal` is the internal force at each node [N], shape (n_nodes, 3)."""
        mesh, loading = problem.mesh, problem.loading if finer is None else finer.loading
        nodes = mesh.nodes if finer is None else finer.nodes
        everywhere = nodes + level.displacement[:, : mesh.dim]
        positions = everywhere[: mesh.n_nodes]
        external = loading.force(everywhere if self.finite else nodes, load_factor)
        reaction = np.where(loading.held, internal[:, : mesh.dim] - external, 0.0)
        energy = math.nan if level.energy is None or (effort and effort.increments > 1) else level.energy
        stretch = None if network is None else network.stretch(positions)
        return State(
            load_factor=load_factor,
            positions=positions,
            all_positions=everywhere,
            displacement=positions - mesh.nodes,
            reaction=reaction if finer is None else on_the_mesh(reaction, finer.parents),
            applied_force=external.sum(axis=0),
            energy=energy if network is None else network.energy(positions),
            iterations=0 if effort is None else effort.iterations,
            residual=math.nan,
            negative_eigenvalues=None,
            branched=False,
            area_ratio=mesh.smallest_area_ratio(positions),
            stretch=None if stretch is None else (float(stretch.min()), float(stretch.max())),
            level=load_factor,
        )


def _message(finished: Finished) -> str:
    """Return the error message of a run."""
    if finished.timeout is not None:
        return f"none, the time limit of {finished.timeout:g} s was reached (--timeout)"
    if finished.errors:
        return f"'{finished.errors[-1]}'"
    return f"none (exit code {finished.code}); is the stiffness singular at rest, or a part of the body free to move?"


def _results(file: Path, n_nodes: int) -> list[tuple[Level, Floats]]:
    """Return the levels of a .dat file, each with the forces at all nodes [N], zero where they are not printed."""
    if not file.is_file() or not file.stat().st_size:  # no step was completed
        return []
    levels = [
        replace(one, energy=None if one.energy is None else FORCE_UNIT * one.energy) for one in read_dat(file).levels
    ]
    return list(zip(levels, _forces(file, n_nodes), strict=False))  # a truncated level has no forces


def _forces(file: Path, n_nodes: int) -> Iterator[Floats]:
    """Yield the printed forces of each step, external loads included [N], shape (n_nodes, 3).

    Source: *NODE PRINT, RF in the CalculiX manual.
    """
    with scanning(file, None) as scan:
        while line := scan.line():
            if line.startswith(b" forces (fx,fy,fz) for set HELD"):
                scan.line()
                lines = list(iter(lambda: scan.line().rstrip(b"\n"), b""))
                nodes, values = scan.columns(lines, 0, (1, 10, "int"), (3, 14, "float"))
                force = np.zeros((n_nodes, 3))
                force[nodes[:, 0] - 1] = FORCE_UNIT * values
                yield force
        scan.done()
