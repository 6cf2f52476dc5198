"""Result: all that one study gave, which everything in this folder draws, tabulates or writes."""

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
    """Return what the comments at the head of a study file say."""
    head = itertools.takewhile(lambda line: line.startswith("#"), source.splitlines())
    return " ".join(line.lstrip("#").strip() for line in head)


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """One study, solved.

    Attributes:
        title: the study's own.
        file: the study's file, as it was named.
        problem: what was asked.
        paths: by the name of the model in the study, in its order.
        probe: number of the node that is watched.
        model: name of the path that is compared with the others; None where nothing is compared.
        comparisons: by name of the reference.
        tolerance: the error, rms or of force, up to which two paths agree.
        source: text of the study file; comments at its head are shown with its results.
        fitness: whether the springs of a path are fit for the material, by its name.
        standings: how far each reference is from its own limit, by its name; empty where none was refined.
        in_detail: whether distances of surfaces, in metres, and energies are told too, and a plane body is coloured by
            its distance, as where two results are compared.
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
        """The file's name without its suffix; names the output folder."""
        return self.file.stem

    @property
    def note(self) -> str:
        """What the comments at the head of the study file say."""
        return head_note(self.source)

    @cached_property
    def closest(self) -> str | None:
        """Name of the reference nearest to the model at full load."""
        return closest(self.comparisons)

    @property
    def converged(self) -> bool:
        """Whether every path reached full load through stable equilibria, but for those that were read."""
        return all(path.status in (Status.CONVERGED, Status.READ) for path in self.paths.values())
