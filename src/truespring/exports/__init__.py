"""Springs for other simulators: a target is one function that returns files, and one line in TARGETS."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from truespring.errors import ExportError, nearest
from truespring.exports.abaqus import abaqus
from truespring.exports.arrays import as_json, npz
from truespring.exports.calculix import calculix
from truespring.exports.decks import check_springs
from truespring.exports.exported import Exported as Exported
from truespring.exports.exported import plain_springs
from truespring.exports.exported import solve_springs as solve_springs
from truespring.exports.mujoco import mujoco
from truespring.exports.sofa import sofa
from truespring.models import Model, SpringNetwork, as_model
from truespring.outputs import Output
from truespring.problem import Problem
from truespring.solvers import Solver

#: The content of each file by its name: text, or bytes.
Files = Mapping[str, str | bytes]


@dataclass(frozen=True)
class Target:
    """Where springs are carried to.

    Attributes:
        files: writes a solved spring model as files; raises ExportError for what they cannot express.
        about: what they are, in a sentence.
        program: the name of a program that knows nothing but springs, empty for what takes any.
        negative: whether it takes springs of negative stiffness.
        names: the files that it writes.
        check: raises ExportError for plain springs or loads that it cannot take, None where it takes all.
    """

    files: Callable[[Exported], Files]
    about: str
    program: str = ""
    negative: bool = True
    names: tuple[str, ...] = ()
    check: Callable[[Problem, SpringNetwork], None] | None = None


_DECKS = ("springs.inp", "fem.inp")

TARGETS: Mapping[str, Target] = MappingProxyType(
    {
        "calculix": Target(
            calculix,
            "CalculiX decks: springs.inp of SPRINGA elements, fem.inp of finite elements",
            "CalculiX",
            names=_DECKS,
            check=check_springs,
        ),
        "abaqus": Target(
            abaqus,
            "the same for Abaqus; Abaqus itself was not run on them",
            "Abaqus",
            names=_DECKS,
            check=check_springs,
        ),
        "mujoco": Target(mujoco, "MuJoCo's MJCF: springs.xml of sliding bodies and tendons", "MuJoCo", negative=False),
        "sofa": Target(
            sofa, "a Python scene for SOFA, of springs and finite elements; experimental: SOFA was not run", "SOFA"
        ),
        "npz": Target(npz, "NumPy arrays: springs.npz"),
        "json": Target(as_json, "the same arrays as text: springs.json"),
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
    """Solve springs and write them for another simulator into `folder`; return the files written.

    `target` is a key of TARGETS. Files tell units, supports, loads, and what our equilibrium is at full load at the
    node `probe`, by default the one that moves most. Raises ExportError for a target that is unknown or cannot
    express the model.
    """
    known_targets([target])
    check_targets([target], problem, model)
    exported = solve_springs(problem, model, solver, title, probe)
    return write_files(target_files(exported, [target])[target], Path(folder))


def known_targets(names: Iterable[str]) -> tuple[str, ...]:
    """Return each name once; raise ExportError for one that is no target."""
    several = tuple(dict.fromkeys(names))
    for name in several:
        if name not in TARGETS:
            raise ExportError(f"target '{name}' is unknown{nearest(name, TARGETS)}; allowed: {', '.join(TARGETS)}")
    return several


def check_targets(names: Collection[str], problem: Problem, model: Model) -> None:
    """Raise ExportError for what a target cannot take, and for two that write one file; solve nothing."""
    if not as_model(model).has_springs:
        raise ExportError(f"{model!r} is no model of springs: give Springs(rule=...) or a SpringNetwork")
    springs = model.potential(problem)
    written: dict[str, str] = {}
    for name in names:
        target = TARGETS[name]
        if target.program:
            network = plain_springs(springs, target.program, target.negative)
            if target.check:
                target.check(problem, network)
        for file in target.names:
            if file in written:
                raise ExportError(
                    f"targets {written[file]} and {name} both write {file}: export them one at a time, "
                    "into folders of their own"
                )
            written[file] = name


def target_files(exported: Exported, names: Collection[str]) -> dict[str, Files]:
    """Return the files of each target; raise ExportError for what one cannot express."""
    return {name: TARGETS[name].files(exported) for name in names}


def write_files(files: Files, folder: Path) -> tuple[Path, ...]:
    """Write files into a folder, which is made where it is not there; return them."""
    with Output(folder, next(iter(files))) as output:
        for file, content in files.items():
            (output.staging / file).write_bytes(content.encode() if isinstance(content, str) else content)
        output.publish()
    return tuple(folder / file for file in files)
