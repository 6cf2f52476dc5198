"""Studies as load cases of a calibration."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from truespring.calibration.calibrated import Calibrated
from truespring.calibration.calibration import REGULARISATION, Progress, calibrate
from truespring.calibration.cases import LoadCase, require_one_body
from truespring.calibration.curve import read_curve
from truespring.calibration.kinds import UNKNOWNS, make_unknowns
from truespring.calibration.turned import turned
from truespring.comparison import most_moved
from truespring.equilibrium import Solution, solve
from truespring.errors import StudyError, TruespringError, nearest
from truespring.models import springs_by_rule
from truespring.problem import Problem
from truespring.reference import read_result
from truespring.refining import COST, in_second_order, own_error, work_of
from truespring.study.last_level import require_last_level
from truespring.study.read import Study
from truespring.study.run import follow


def calibrate_study(
    study: Study,
    cases: Sequence[Study] = (),
    held_out: Sequence[Study] = (),
    unknowns: str | None = None,
    to: str | None = None,
    markers: Path | None = None,
    curve: Path | None = None,
    regularisation: float = REGULARISATION,
    progress: Progress | None = None,
) -> Calibrated:
    """Fit the springs of a study to a reference under its load and those of further cases, on one mesh.

    Args:
        study: study with the springs.
        cases: studies whose loads are fitted too.
        held_out: studies whose loads are used for testing; by default the load of the study rotated by 45 degrees, if
            its reference converges.
        unknowns: a key of UNKNOWNS; by default the first that suits springs of the study.
        to: name of the reference in the studies; by default neo-Hookean FEM, else FEM with another nonlinear law, else
            the first model that is not springs.
        markers: file of markers measured under the study's load, used as reference.
        curve: file of a force-displacement curve measured under the study's load, used as reference.
        regularisation: weight of the term toward the rule.
        progress: called with the current step and the share of the work done.

    Raises StudyError, with the file, if the studies do not fit together, or one is a motion or returns before its end.
    """
    name = springs_of(study, unknowns)
    model = springs_by_rule(study.entries)[name]
    for one in (study, *cases, *held_out):
        _require_newton(one)
        require_last_level(one, "calibrate")
    for one in (*cases, *held_out):
        with _naming(study):
            require_one_body([(str(one.file), one.problem)], study.problem)
    with _naming(study):
        make_unknowns(study.problem, model, unknowns)  # raises errors before anything is solved
    measured = markers is not None or curve is not None
    names = [_reference(one, to) for one in (*([] if measured else [study]), *cases, *held_out)]
    own = [*([] if measured else [study]), *cases, *held_out]
    found = {}
    for number, (one, reference) in enumerate(zip(own, names, strict=True)):
        if progress:
            progress(f"{one.stem}: {reference}", 0.5 * number / max(len(own), 1))
        found[one.file] = _case(one, reference)
    fitted = [_measured(study, name, markers, curve)] if measured else [found[study.file]]
    fitted += [found[one.file] for one in cases]
    tested = [found[one.file] for one in held_out]
    if not held_out and not measured:
        tested = list(_turned(study, names[0]))

    def second_half(text: str, share: float) -> None:
        if progress:
            progress(text, 0.5 + 0.5 * share)

    with _naming(study):
        calibration = calibrate(fitted, model, unknowns, tested, regularisation, progress=second_half)
    files = [str(file) for file in (markers, curve) if file is not None]
    return Calibrated(study, name, ", ".join(files) or names[0], calibration)


def springs_of(study: Study, unknowns: str | None = None) -> str:
    """Return the name of the springs to calibrate: the compared model if these unknowns suit it, else the first.

    Without `unknowns`, the first kind of UNKNOWNS that suits springs of the study.
    """
    by_rule = springs_by_rule(study.entries)
    kinds = list(UNKNOWNS) if unknowns is None else [unknowns]
    suited = [
        [name for name, entry in by_rule.items() if kind in UNKNOWNS and UNKNOWNS[kind].suits(study.problem, entry)]
        for kind in kinds
    ]
    springs = next(filter(None, suited), list(by_rule))
    if not springs:
        raise StudyError(
            f"{study.file}: models: none of {', '.join(study.entries)} is springs of a rule or of given stiffness: "
            "add one"
        )
    return study.model if study.model in springs else springs[0]


def _reference(study: Study, to: str | None) -> str:
    """Return the name of the model that the springs of a study are fitted to."""
    known = [name for name in study.entries if name not in springs_by_rule(study.entries)]
    if to is not None and to not in known:
        there = f"allowed: {', '.join(known)}" if known else "the study has springs only: add a model of kind fem"
        raise StudyError(f"{study.file}: --to {to}: no such reference{nearest(to, known)}; {there}")
    if not known:
        raise StudyError(f"{study.file}: models: there is no reference for the springs: add a model of kind fem")
    if to is not None:
        return to
    fem = {name: entry for name, entry in study.entries.items() if entry.chosen_element(study.problem)}
    best = [name for name, entry in fem.items() if entry.law == "neo-hookean"]
    best += [name for name, entry in fem.items() if entry.finite]
    return (best or known)[0]


def _case(study: Study, reference: str) -> LoadCase:
    path, described = _reference_path(study, study.problem, reference)
    _require_complete(study, reference, path)
    with _naming(study):
        return LoadCase(study.stem, study.problem, path, None, study.solver, *described)


def _reference_path(study: Study, problem: Problem, reference: str) -> tuple[Solution, tuple[str, float | None]]:
    """Return the reference path, its description and its own error.

    If the study does not set the kind of finite elements, they are of second order on the nodes of the springs: on
    meshes for springs, first-order elements often have larger errors than springs fitted to them.
    """
    entry = study.entries[reference]
    better = in_second_order(problem, entry)
    if better is not None:
        problem, entry = better
        path = solve(problem, entry, study.solver)
    else:
        path = follow(study, entry) if problem is study.problem else solve(problem, entry, study.solver)
    own = own_error(path, entry, study.solver, COST * work_of(path))
    kind = " of second order on the same nodes" if better else ""
    return path, (f"{path.label}{kind}", own.value)


def _measured(study: Study, springs: str, markers: Path | None, curve: Path | None) -> LoadCase:
    """Return the load of the study with data measured under it."""
    seen = None if markers is None else read_result(markers)
    measured = None
    if curve is not None:
        probe = study.probe
        if probe is None:
            probe = most_moved(solve(study.problem, study.entries[springs], study.solver))
        measured = read_curve(curve, study.problem, probe)
    with _naming(study):
        return LoadCase(study.stem, study.problem, seen, measured, study.solver)


def _turned(study: Study, reference: str) -> Iterator[LoadCase]:
    """Yield the load of the study rotated by 45 degrees, if that is possible and its reference converges."""
    entry = study.entries[reference]
    problem = turned(study.problem, math.pi / 4)
    if problem is None or not entry.chosen_element(problem):
        return
    path, described = _reference_path(study, problem, reference)
    if path.complete:
        name = f"{study.stem}, its load turned by 45 degrees"
        yield LoadCase(name, problem, path, None, study.solver, *described)


def _require_complete(study: Study, reference: str, path: Solution) -> None:
    if not path.complete:
        raise StudyError(
            f"{study.file}: reference '{reference}' is {path.status} and ends at load factor {path.load_factor:.6g}: "
            "reduce the load, use more load_steps, or choose another reference by --to"
        )


def _require_newton(study: Study) -> None:
    if not study.solver.follows_load:
        raise StudyError(f'{study.file}: solver.control: calibration needs control = "load"')


@contextmanager
def _naming(study: Study) -> Iterator[None]:
    """Prefix errors with the study file."""
    try:
        yield
    except StudyError:
        raise
    except TruespringError as error:
        raise StudyError(f"{study.file}: {error}") from None
