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
    """Load type, rule, and mesh and material of a path of springs."""

    load: str
    rule: str
    spot: Spot


@dataclass(frozen=True, eq=False)
class Map:
    """Errors of one springs model under one load type.

    Attributes:
        load, rule: load type and springs.
        x, y: values along both axes, shapes (n_x,) and (n_y,); y is empty for a single row.
        errors: relative errors, shape (n_y, n_x); NaN if springs or reference do not reach a point.
        smooth: values along y and errors there on a finer grid, for lines and figures.
        deviations: of the solved springs, by mesh and material.
        failures: reasons for springs that could not be solved, by mesh and material.
        references: by Poisson's ratio.
        full: number of springs paths on the whole grid.
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
    def unavailable(self) -> str:
        """Why there is no map; empty if there is one."""
        return "" if self.deviations else next(iter(self.failures.values()))


@dataclass(frozen=True, eq=False)
class Maps:
    """Maps of a study.

    Attributes:
        title, stem, body: of the study.
        law: law of the reference.
        x, y: names of the axes; y is None for a single axis.
        axes: axes of numbers other than the load, by name.
        maps: one per load type and springs model.
        references: all references.
        tolerance: relative error up to which springs agree with the reference.
        solves: number of solved paths of springs, and of references.
        full: number of springs paths on the whole grid.
        seconds: wall time.
        notes: remarks on values that were left out.
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
        """Whether every reference converged and every map is available."""
        return all(one.converged for one in self.references) and not any(one.unavailable for one in self.maps)
