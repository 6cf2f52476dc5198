"""What `run` solves and compares: a problem, its solver and its models."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from truespring.comparison import TOLERANCE
from truespring.errors import ProblemError, nearest, shown
from truespring.mesh import probe_node
from truespring.models import Model, as_model, check_fibres
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.report.series import Form
from truespring.solvers import Newton, Solver, as_solver


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """A problem, its solver and its models, and which of them are compared.

    Attributes:
        title: title of the report.
        problem, solver: the problem and its solver.
        entries: the models by name: solved here, by another program, or read from a file (ReadSolution).
        model: name of the model that is compared with the references.
        references: names of the reference models.
        probe: number of the probe's node; None for the node that moves most.
        tolerance: largest error, rms or of force, at which two results agree.
        refine: whether each reference is also solved on a finer mesh to estimate its discretisation error.
        form: form of the files of the levels.
    """

    title: str
    problem: Problem
    solver: Solver
    entries: Mapping[str, Model]
    model: str
    references: tuple[str, ...]
    probe: int | None
    tolerance: float
    refine: bool = True
    form: Form = "vtu"

    @property
    def file(self) -> Path:
        """Path of the study file as the user gave it; without a file, the title as a name of a folder."""
        return Path(re.sub(r"[^\w-]+", "-", self.title))

    @property
    def source(self) -> str:
        """Text of the study file; empty without a file."""
        return ""

    @property
    def stem(self) -> str:
        """Name of the output folder: that of the file without its suffix."""
        return self.file.stem


def case_of(
    problem: Problem,
    models: Mapping[str, Model | Potential],
    *,
    model: str | None = None,
    references: Sequence[str] | None = None,
    solver: Solver | None = None,
    probe: int | str | Sequence[float] | None = None,
    tolerance: float = TOLERANCE,
    refine: bool = True,
    title: str = "problem",
) -> Case:
    """Return the case of a problem with models by name, which are compared as those of a study.

    Raises ProblemError if there is no model, if a name is unknown or cannot be that of a file, if `tolerance` is not
    between 0 and 1 or `title` is not a text, ModelError if a model has the wrong type or does not fit the problem,
    MeshError if the probe does not exist.
    """
    if not models or not isinstance(models, Mapping):
        raise ProblemError("verify needs models: models={'springs': Springs(rule='gaussian'), 'fem': Fem(...)}")
    if not isinstance(tolerance, int | float) or not 0 < tolerance < 1:
        raise ProblemError(f"tolerance = {shown(tolerance)} is not between 0 and 1")
    if not isinstance(title, str) or not title.strip():
        raise ProblemError(f"title = {shown(title)}: a text is expected, such as 'my body'")
    for name in models:
        if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
            raise ProblemError(f"models: '{name}' is not a name: use letters, digits, - and _, such as 'springs'")
    entries = {name: as_model(model) for name, model in models.items()}
    for entry in entries.values():
        check_fibres(problem, entry)
    compared = compared_model(entries, model)
    return Case(
        title=title,
        problem=problem,
        solver=Newton() if solver is None else as_solver(solver),
        entries=entries,
        model=compared,
        references=reference_names(entries, compared, references),
        probe=None if probe is None else probe_node(problem.mesh, probe),
        tolerance=tolerance,
        refine=refine,
    )


def compared_model(models: Mapping[str, Model], model: str | None = None) -> str:
    """Return the name of the model that is compared with the others: `model`, else the first springs, else the first.

    Raises ProblemError for an unknown name.
    """
    if model is not None:
        return _known(models, model)
    springs = [name for name, one in models.items() if one.has_springs]
    return (springs or list(models))[0]


def reference_names(models: Mapping[str, Model], model: str, references: Sequence[str] | None) -> tuple[str, ...]:
    """Return the names of the models that `model` is compared with: `references`, by default all others.

    Raises ProblemError for an unknown name, or for that of the model itself.
    """
    if references is None:
        return tuple(name for name in models if name != model)
    if isinstance(references, str) or not isinstance(references, Sequence):
        raise ProblemError(f"references = {shown(references)}: a list of names is expected, such as ['fem']")
    for reference in references:
        if _known(models, reference) == model:
            raise ProblemError(
                f"'{reference}' is the compared model itself: name other models, or leave the list empty"
            )
    return tuple(dict.fromkeys(references))


def _known(models: Mapping[str, Model], name: str) -> str:
    if not isinstance(name, str) or name not in models:
        raise ProblemError(f"{shown(name)} is not among the models{nearest(str(name), models)}: {', '.join(models)}")
    return name
