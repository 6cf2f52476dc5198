"""The results of one study, which this package draws, tabulates and writes."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from truespring.comparison import Comparison, closest
from truespring.equilibrium import FINE, Solution
from truespring.models import Fitness
from truespring.problem import Problem
from truespring.refining import Standing
from truespring.report.series import Form


@dataclass(frozen=True)
class MotionErrors:
    """Errors of a motion besides that of its model, relative to the same model.

    Each is the root mean square over nodes and recorded times, as `Comparison.rms_error` of a motion.

    Attributes:
        step: that of the time step, against steps half as long, both solved [-]; None if not known.
        solver: that of a fixed number of iterations, against solved steps [-]; 0 for solved steps, None if not known.
        notes: why an error is not known.
    """

    step: float | None
    solver: float | None
    notes: tuple[str, ...] = ()


def head_note(source: str) -> str:
    """Return the comments at the head of a study file as one text."""
    head = itertools.takewhile(lambda line: line.startswith("#"), source.splitlines())
    return " ".join(line.lstrip("#").strip() for line in head)


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """The solutions and comparisons of one study, as `ts.verify` returns them.

    Attributes:
        title: title of the study.
        file: path of the study file, as given.
        problem: mesh, material, supports and loads.
        solutions: solution of each model, by its name, in the order of the study.
        probe: number of the watched node.
        model: name of the model that is compared with the others; None if nothing is compared.
        comparisons: by name of the reference.
        tolerance: relative error, rms or of force, up to which two paths agree.
        source: text of the study file; comments at its head are shown with its results.
        fitness: whether springs fit the material, by name of the model.
        standings: estimated error of each reference, by its name; empty if none was refined.
        splits: errors of the time step and of the solver in a motion of the model; None at rest, or if not known.
        in_detail: whether distances of surfaces [m] and energies are reported too, and plane bodies coloured by
            distance, as in comparisons of two results.
        form: form of the files of the levels.

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
        >>> result = ts.verify(problem, models=models, refine=False)
        >>> list(result.solutions), list(result.comparisons), result.converged
        (['springs', 'fem'], ['fem'], True)
        >>> print(result.verdict)
        Up to full load springs stay within 5 % of neo-Hookean FEM. At full load: neo-Hookean FEM 0.56 %.
    """

    title: str
    file: Path
    problem: Problem
    solutions: Mapping[str, Solution]
    probe: int
    model: str | None
    comparisons: Mapping[str, Comparison]
    tolerance: float
    source: str
    fitness: Mapping[str, Fitness] = field(default_factory=dict)
    standings: Mapping[str, Standing] = field(default_factory=dict)
    splits: MotionErrors | None = None
    in_detail: bool = False
    form: Form = "vtu"

    def __repr__(self) -> str:
        return f"Result({self.stem}, {list(self.solutions.values())})"

    def _repr_html_(self) -> str:
        """Return the result as HTML for a notebook: a table and a picture."""
        from truespring.showing.values import html_of

        return html_of(self)

    @property
    def stem(self) -> str:
        """Name of the study file without suffix, and of its output folder."""
        return self.file.stem

    @property
    def note(self) -> str:
        """The comments at the head of the study file."""
        return head_note(self.source)

    @cached_property
    def closest(self) -> str | None:
        """Name of the reference nearest to the model at full load."""
        return closest(self.comparisons)

    @property
    def comparison(self) -> Comparison | None:
        """The comparison with the reference nearest to the model at full load; None if nothing is compared."""
        return None if self.closest is None else self.comparisons[self.closest]

    @property
    def verdict(self) -> str:
        """How far the model may be trusted, in sentences: trouble, agreement with the references, separate errors."""
        from truespring.showing.results import verdict_of

        return verdict_of(self)

    def report(self, path: str | Path) -> Path:
        """Write the report as one HTML file that needs no network; return its path.

        Raises OutputError if it cannot be written.
        """
        from truespring.showing.results import write_report

        return write_report(self, Path(path))

    @property
    def converged(self) -> bool:
        """Whether every solved path reached full load through stable equilibria."""
        return all(path.status in FINE for path in self.solutions.values())
