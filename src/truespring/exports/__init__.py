"""Export of spring models to other programs: each target is a function that returns files, and an entry of TARGETS."""

import json
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from truespring.errors import ExportError, nearest
from truespring.exports.abaqus import abaqus
from truespring.exports.arrays import as_json, npz
from truespring.exports.calculix import calculix
from truespring.exports.decks import SPRINGA
from truespring.exports.exported import Exported as Exported
from truespring.exports.exported import solve_springs as solve_springs
from truespring.exports.exported import spring_data
from truespring.exports.features import ALL, Feature, UntakenError, refuse_others
from truespring.exports.mujoco import mujoco
from truespring.exports.sofa import sofa
from truespring.models import Model, as_model
from truespring.models.spring_data import SpringData
from truespring.outputs import Output
from truespring.problem import Problem
from truespring.solvers import Solver

#: The content of each file by its name: text, or bytes.
Files = Mapping[str, str | bytes]


@dataclass(frozen=True)
class Target:
    """A program or format that spring models are exported to.

    Attributes:
        files: returns the files of solved springs, whose features are all in `takes`.
        about: one-line description of the files.
        program: name in error messages.
        names: names of the files; all but the first are optional.
        takes: supported features of springs and loads; any other makes `check_targets` raise ExportError.
        expressed: how springs and loads are expressed, as a sentence, for exported.json.
        left_out: what of the study is not in the files, as a sentence.
        unrun: why no test runs the program on the files; empty if a test does.
    """

    files: Callable[[Exported], Files]
    about: str
    program: str
    names: tuple[str, ...]
    takes: frozenset[Feature]
    expressed: str
    left_out: str
    unrun: str = ""


_DECKS = ("springs.inp", "fem.inp")
_IN_DECKS = "springs.inp has the springs as SPRINGA elements; fem.inp has the same body as finite elements."
_NOT_IN_DECKS = "Density and contact are left out; weight is in the nodal forces."
_ARRAYS = "All springs, elements, constants, supports and loads are arrays; see docs/export/arrays.md."
_NOTHING = "Nothing of the model is left out."
_FOLLOWED = frozenset({Feature.PRESTRESS, Feature.FOLLOWING})

TARGETS: Mapping[str, Target] = MappingProxyType(
    {
        "calculix": Target(
            calculix,
            "CalculiX decks: springs.inp of SPRINGA elements, fem.inp of finite elements",
            "CalculiX",
            _DECKS,
            SPRINGA,
            expressed=_IN_DECKS,
            left_out=_NOT_IN_DECKS,
        ),
        "abaqus": Target(
            abaqus,
            "the same for Abaqus",
            "Abaqus",
            _DECKS,
            SPRINGA,
            expressed=_IN_DECKS,
            left_out=_NOT_IN_DECKS,
            unrun="Abaqus was not run; CalculiX reads the same keywords",
        ),
        "mujoco": Target(
            mujoco,
            "MuJoCo MJCF: springs.xml of bodies on slide joints and spatial tendons",
            "MuJoCo",
            ("springs.xml",),
            _FOLLOWED,
            expressed="Nodes are bodies on slide joints, springs are spatial tendons, loads are actuators.",
            left_out="The body has no surface and no contact.",
        ),
        "sofa": Target(
            sofa,
            "a Python scene for SOFA, of springs and finite elements; experimental",
            "SOFA",
            ("springs_scene.py",),
            _FOLLOWED | {Feature.NEGATIVE},
            expressed="Springs are a MeshSpringForceField, finite elements a node of their own, loads constant forces.",
            left_out="Contact is not set up.",
            unrun="SOFA was not run; the scene is checked against the source code of SOFA",
        ),
        "npz": Target(npz, "NumPy arrays: springs.npz", "npz", ("springs.npz",), ALL, _ARRAYS, _NOTHING),
        "json": Target(
            as_json, "the same arrays as text: springs.json", "json", ("springs.json",), ALL, _ARRAYS, _NOTHING
        ),
    }
)


def export(
    problem: Problem,
    model: Model,
    target: str,
    folder: str | Path,
    solver: Solver | None = None,
    title: str = "Springs",
    probe: int | None = None,
) -> tuple[Path, ...]:
    """Solve a spring model, write it to `folder` for another program, and return the files written.

    `target` is a key of TARGETS. Each file states units, supports, loads and the displacement of the node `probe` at
    full load, by default the free node that moves most; exported.json has what to expect, see `expectation`. Raises
    ExportError if the target is unknown or does not support the model.
    """
    known_targets([target])
    check_targets([target], problem, model)
    exported = solve_springs(problem, model, solver, title, probe)
    return write_files(with_expectation(exported, target, target_files(exported, [target])[target]), Path(folder))


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


def target_files(exported: Exported, names: Collection[str]) -> dict[str, Files]:
    """Return the files of each target; raise ExportError for a feature that a target does not support."""
    for name in names:
        refuse_untaken(name, exported.problem, exported.springs)
    return {name: TARGETS[name].files(exported) for name in names}


def write_files(files: Files, folder: Path) -> tuple[Path, ...]:
    """Write files to a folder, creating it if necessary, and return their paths."""
    with Output(folder, next(iter(files))) as output:
        for file, content in files.items():
            (output.staging / file).write_bytes(content.encode() if isinstance(content, str) else content)
        output.publish()
    return tuple(folder / file for file in files)
