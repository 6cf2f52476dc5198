"""Data of validity maps: the errors of springs against a converged reference."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from truespring.arrays import Floats
from truespring.validity.axes import Axis
from truespring.validity.bodies import Body, Spot
from truespring.validity.deviation import Deviation
from truespring.validity.loads import LoadType
from truespring.validity.reference import Reference
from truespring.validity.rules import MappedSprings


class Key(NamedTuple):
    """What one path of springs is of."""

    load: str
    rule: str
    spot: Spot


@dataclass(frozen=True, eq=False)
class Map:
    """Errors of one springs model under one load type.

    Attributes:
        load, rule: of what.
        x, y: the values along both axes, shapes (n_x,) and (n_y,); y is (0,) where there is one row only.
        errors: relative, shape (n_y, n_x); not a number where springs or reference do not reach.
        smooth: values along y, and errors there, between those of the grid too, for lines and pictures.
        deviations: what was solved, by its place along y, or along x and y where x is not the load.
        failures: where springs cannot be had, and why.
        references: by Poisson's ratio.
        full: the number of springs paths that the whole grid would have taken.
    """

    load: LoadType
    rule: MappedSprings
    x: Floats
    y: Floats
    errors: Floats
    smooth: tuple[Floats, Floats]
    deviations: Mapping[Spot, Deviation]
    failures: Mapping[Spot, str]
    references: Mapping[float | None, Reference]
    full: int

    @property
    def refused(self) -> str:
        """Why there is no map at all, empty where there is one."""
        return "" if self.deviations else next(iter(self.failures.values()))


@dataclass(frozen=True, eq=False)
class Maps:
    """Maps of a study.

    Attributes:
        title, stem: of the study; `body` what was mapped.
        law: of the reference.
        x, y: names of the axes; y is None where there is one only.
        axes: those of numbers other than the load, by name.
        maps: one a load type and springs model.
        references: all that were solved.
        tolerance: what "agrees" means in the first verdict.
        solves: paths of springs and of references that were solved; `full` what the whole grid would have taken.
        seconds: wall time.
        notes: what was left out.
    """

    title: str
    stem: str
    body: Body
    law: str
    x: str
    y: str | None
    axes: Mapping[str, Axis]
    maps: tuple[Map, ...]
    references: tuple[Reference, ...]
    tolerance: float
    solves: tuple[int, int]
    full: int
    seconds: float
    notes: tuple[str, ...] = field(default=())

    @property
    def converged(self) -> bool:
        """Whether every reference is, and there is a map of all that was asked for."""
        return all(one.converged for one in self.references) and not any(one.refused for one in self.maps)
