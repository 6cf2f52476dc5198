"""Export of spring models to other programs: each target is a function that returns files, and an entry of TARGETS."""

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from truespring.errors import ExportError, nearest
from truespring.exports.exported import Exported as Exported
from truespring.exports.exported import solve_springs as solve_springs
from truespring.exports.exported import spring_data
from truespring.exports.features import UntakenError, refuse_others
from truespring.exports.options import OptionValue as OptionValue
from truespring.exports.options import options_of
from truespring.exports.options import read_options as read_options
from truespring.exports.table import TARGETS as TARGETS
from truespring.exports.target import Files as Files
from truespring.exports.target import Target as Target
from truespring.models import Model, as_model
from truespring.models.spring_data import SpringData
from truespring.outputs import Output
from truespring.problem import Problem
from truespring.solvers import Solver


def export(
    problem: Problem,
    model: Model,
    target: str,
    folder: str | Path,
    solver: Solver | None = None,
    title: str = "Springs",
    probe: int | None = None,
    options: Mapping[str, OptionValue] | None = None,
) -> tuple[Path, ...]:
    """Solve a spring model, write it to `folder` for another program, and return the files written.

    `target` is a key of TARGETS, `options` are those of the target by name. Each file states units, supports, loads and
    the displacement of the node `probe` at full load, by default the free node that moves most; exported.json has what
    to expect, see `expectation`. Raises ExportError if the target or an option is unknown, or if the target does not
    support the model.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> files = ts.export(problem, ts.Springs("isotropic"), "obj", "out")
        >>> [file.name for file in files]
        ['rest.obj', 'deformed.obj', 'exported.json']
    """
    known_targets([target])
    check_options([target], options)
    check_targets([target], problem, model)
    exported = solve_springs(problem, model, solver, title, probe)
    files = target_files(exported, [target], options)[target]
    return write_files(with_expectation(exported, target, files), Path(folder))


def check_options(names: Collection[str], options: Mapping[str, OptionValue] | None) -> None:
    """Raise ExportError for an option that none of the targets has, or a value that it cannot have."""
    options_of(options or {}, names, TARGETS)


def with_expectation(exported: Exported, target: str, files: Files) -> Files:
    """Return the files of a target with exported.json, which states what they express and what to expect."""
    known = TARGETS[target]
    values = {
        "target": target,
        "files": list(files),
        "expressed": known.expressed,
        "left_out": known.left_out,
        "not_run": known.unrun,
        **exported.expectation,
        **known.details(exported),
    }
    return {**files, "exported.json": json.dumps(values, indent=2, allow_nan=False) + "\n"}


def known_targets(names: Iterable[str]) -> tuple[str, ...]:
    """Return the distinct names, in order; raise ExportError for a name that is not in TARGETS."""
    several = tuple(dict.fromkeys(names))
    for name in several:
        if name not in TARGETS:
            raise ExportError(f"target '{name}' is unknown{nearest(name, TARGETS)}; allowed: {', '.join(TARGETS)}")
    return several


def check_targets(names: Collection[str], problem: Problem, model: Model) -> None:
    """Raise ExportError for the first target that does not support the springs and loads; solve nothing."""
    for error in unsupported(names, problem, model).values():
        raise error


def unsupported(names: Iterable[str], problem: Problem, model: Model) -> dict[str, ExportError]:
    """Return the targets that do not support the springs and loads, each with the reason; solve nothing.

    Raises ExportError if the model has no springs.
    """
    if not as_model(model).has_springs:
        raise ExportError(f"{model!r} is not a spring model: use Springs(rule=...) or a SpringNetwork")
    springs, found = spring_data(model.potential(problem)), {}
    for name in names:
        try:
            refuse_untaken(name, problem, springs)
        except ExportError as error:
            found[name] = error
    return found


def refuse_untaken(name: str, problem: Problem, springs: SpringData) -> None:
    """Raise ExportError for features of springs and loads that a target does not support, and list those that do."""
    try:
        refuse_others(problem, springs, TARGETS[name].takes, TARGETS[name].program)
    except UntakenError as error:
        others = ", ".join(other for other, target in TARGETS.items() if error.feature in target.takes)
        raise ExportError(f"{error}; targets that support it: {others}") from None


def target_files(
    exported: Exported, names: Collection[str], options: Mapping[str, OptionValue] | None = None
) -> dict[str, Files]:
    """Return the files of each target; raise ExportError for features and options that a target does not support."""
    chosen = options_of(options or {}, TARGETS, TARGETS)  # an option of a target that is not among these has no effect
    for name in names:
        refuse_untaken(name, exported.problem, exported.springs)
    return {name: TARGETS[name].files(replace(exported, options=chosen[name])) for name in names}


def write_files(files: Files, folder: Path) -> tuple[Path, ...]:
    """Write files to a folder, creating it if necessary, and return their paths."""
    with Output(folder, next(iter(files))) as output:
        for file, content in files.items():
            (output.staging / file).write_bytes(content.encode() if isinstance(content, str) else content)
        output.publish()
    return tuple(folder / file for file in files)
