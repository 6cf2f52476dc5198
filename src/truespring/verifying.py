"""Verify studies: solve and compare their models, and write curves, figures and a report."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from truespring.errors import ProblemError, StudyError, shown
from truespring.models import Model
from truespring.outputs import writing
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.report.result import Result
from truespring.showing.progress import bars, chosen
from truespring.solution import Solution
from truespring.solvers import Solver
from truespring.study import (
    Case,
    Progress,
    Study,
    case_of,
    output,
    read_study,
    run,
    verify_command,
    write_model,
    write_overview,
    write_rest,
)

_LOGGER = logging.getLogger(__name__)

#: Returns a context that shows the progress while it is open, by the callback that it yields.
Bars = Callable[[], AbstractContextManager[Progress | None]]


def verify(
    study: Study | Problem | str | Path,
    out: str | Path | None = None,
    progress: bool | Progress = True,
    *,
    models: Mapping[str, Model | Potential] | None = None,
    model: str | None = None,
    references: Sequence[str] | None = None,
    solver: Solver | None = None,
    probe: int | str | Sequence[float] | None = None,
    tolerance: float | None = None,
    refine: bool | None = None,
    title: str | None = None,
    timeout: float | None = None,
    animate: bool = False,
) -> Result:
    """Solve the models of a study and compare the springs with the references, as the command `truespring verify`.

    The springs, of several the first, are compared with all other models, or as `[compare]` of the study says. A model
    that fails keeps the load levels that it reached: see `Result.converged`.

    Args:
        study: path of a study, or a study from `read_study`; or a problem with `models`.
        out: folder for the files of the command: OUT/STEM/ with summary.json, curves.csv, VTU and STL files, figures
            and report.html, and OUT/report.html. By default no file is written.
        progress: whether to show a progress bar in a notebook or terminal; or a callback with study, model and the
            load factor reached.
        models: of a problem, the models by name, as in the example. This argument and those up to `title` are for a
            problem; a study has its own values.
        model: name of the model that is compared with the others; by default the first springs.
        references: names of the models that it is compared with; by default all others.
        solver: Newton by default.
        probe: node number, named point such as "right-middle", or position [m]; by default the node that moves most.
        tolerance: largest error at which two models agree, 0.05 by default.
        refine: whether to solve each reference also on a finer mesh, to estimate its discretisation error; by default
            it is.
        title: title of the report and name of its folder, "problem" by default.
        timeout: time limit [s] of each model and of the refinement of each reference.
        animate: whether to write animation.gif, and animation.mp4 if imageio-ffmpeg is installed.

    Raises StudyError for a wrong study, ProblemError, ModelError or MeshError for wrong models or options, OutputError
    if the folder cannot be written.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> models = {"springs": ts.Springs("gaussian"), "fem": ts.Fem("neo-hookean")}
        >>> result = ts.verify(problem, models=models)
        >>> f"{result.comparison.rms_error:.1%}"
        '0.6%'
    """
    options = {
        "model": model,
        "references": references,
        "solver": solver,
        "probe": probe,
        "tolerance": tolerance,
        "refine": refine,
        "title": title,
    }
    if timeout is not None and not (isinstance(timeout, int | float) and timeout > 0):
        raise ProblemError(f"timeout = {shown(timeout)}: a time above 0 s is expected, such as 60")
    case = _case(study, models, {key: value for key, value in options.items() if value is not None})
    folder = None if out is None else Path(out)
    ((result, _),) = verify_each([case], folder, lambda: chosen(progress, bars), timeout=timeout, animate=animate)
    return result


def _case(
    study: Study | Problem | str | Path, models: Mapping[str, Model | Potential] | None, options: Mapping[str, Any]
) -> Case:
    """Return what to solve; raise StudyError for models or options beside a study, which has its own."""
    if isinstance(study, Problem):
        return case_of(study, models or {}, **options)
    given = [*(["models"] if models is not None else []), *options]
    if given:
        raise StudyError(
            f"{', '.join(given)}: a study has its own models and settings: change keys by "
            'read_study(file, **{"compare.tolerance": 0.02}), or verify a Problem'
        )
    return study if isinstance(study, Study) else read_study(study)


def verify_each(
    cases: Sequence[Case],
    out: Path | None,
    display: Bars = nullcontext,
    *,
    comparing: bool = True,
    timeout: float | None = None,
    animate: bool = False,
) -> Iterator[tuple[Result, str]]:
    """Yield the result of each case after its files were written to OUT/STEM/, and a note on an animation that failed.

    After the last one OUT/report.html is written.

    Args:
        cases: studies and other cases with distinct stems.
        out: folder for the results; None writes nothing.
        display: returns a context that shows the progress of a case.
        comparing: whether to compare the models, and to write figures and reports.
        timeout: time limit [s] of each model and of the refinement of each reference.
        animate: whether to write animations.

    Raises OutputError if the folder cannot be written.
    """
    results = []
    for case in cases:
        if out is None:
            with display() as advance:
                found = run(case, advance, comparing, timeout), ""
        else:
            found = _written(case, out, display, comparing, timeout, animate)
        results.append(found[0])
        yield found
    if comparing and out is not None:
        with writing(out):
            write_overview(results, out, animate)


def _written(
    case: Case, out: Path, display: Bars, comparing: bool, timeout: float | None, animate: bool
) -> tuple[Result, str]:
    """Run a case and write its files; see `verify_each`. The files of each model are written when it is solved."""
    with writing(out):
        opened = output(case, out)

    def known(name: str, path: Solution) -> None:
        with writing(out):
            write_model(path, opened, name, case.form)

    with opened:
        with display() as advance:
            result = run(case, advance, comparing, timeout, known)
        with writing(out):
            (out / "report.html").unlink(missing_ok=True)  # a report of an earlier command
            note = write_rest(result, opened, verify_command([result], out, animate), comparing, animate)
    _LOGGER.info("%s: written to %s", case.stem, opened.folder)
    return result, note
