"""The results of one study, which this package draws, tabulates and writes."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from truespring.comparison import Comparison, closest
from truespring.equilibrium import Solution, Status
from truespring.models import Fitness
from truespring.problem import Problem
from truespring.refining import Standing


def head_note(source: str) -> str:
    """Return the comments at the head of a study file as one text."""
    head = itertools.takewhile(lambda line: line.startswith("#"), source.splitlines())
    return " ".join(line.lstrip("#").strip() for line in head)


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """The solutions and comparisons of one study.

    Attributes:
        title: title of the study.
        file: path of the study file, as given.
        problem: mesh, material, supports and loads.
        paths: solution of each model, by its name, in the order of the study.
        probe: number of the watched node.
        model: name of the model that is compared with the others; None if nothing is compared.
        comparisons: by name of the reference.
        tolerance: relative error, rms or of force, up to which two paths agree.
        source: text of the study file; comments at its head are shown with its results.
        fitness: whether springs fit the material, by name of the model.
        standings: estimated error of each reference, by its name; empty if none was refined.
        in_detail: whether distances of surfaces [m] and energies are reported too, and plane bodies coloured by
            distance, as in comparisons of two results.
    """

    title: str
    file: Path
    problem: Problem
    paths: Mapping[str, Solution]
    probe: int
    model: str | None
    comparisons: Mapping[str, Comparison]
    tolerance: float
    source: str
    fitness: Mapping[str, Fitness] = field(default_factory=dict)
    standings: Mapping[str, Standing] = field(default_factory=dict)
    in_detail: bool = False

    def __repr__(self) -> str:
        return f"Result({self.stem}, {list(self.paths.values())})"

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
    def converged(self) -> bool:
        """Whether every solved path reached full load through stable equilibria."""
        return all(path.status in (Status.CONVERGED, Status.READ) for path in self.paths.values())
