"""Keyword decks for CalculiX and Abaqus, which read the same keywords; a Dialect holds the differences.

Decks count nodes and elements from 1: node i of truespring is node i + 1.
Source: CalculiX CrunchiX User's Manual, https://www.dhondt.de; Abaqus Keywords Reference.
"""

import itertools
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Loading
from truespring.errors import ExportError
from truespring.exports.exported import Exported, printable

#: Writes results only of the last increment of a step.
LAST_ONLY = "FREQUENCY=1000000"

# Limit of the first increment, as a share of the full load: larger ones may converge to another equilibrium.
_LARGEST_INCREMENT = 0.25
# Period of a step that is not a load level.
_NO_TIME = 1e-9
# Numbers per line.
_A_LINE = 16


class Step(NamedTuple):
    """A step: its number from 1, its increase of the load factor, and the first increment of that.

    Time is the load factor in all decks, so results are labelled with their level.
    """

    number: int
    period: float
    first_increment: float


@dataclass(frozen=True)
class Solids:
    """The hyperelastic elements of a program.

    Attributes:
        names: types that differ from those of *ELASTIC, by the latter.
        overlaid: types of *ELASTIC that elements of mean strain are put over, which carry the stiffness against a
            change of volume; see `twins`.
        control: returns the stiffness against hourglass modes that the program adds to elements of mean strain, see
            `mean_strain.hourglass_control`; None if it adds nothing that matters.
        least_shear: C10 of elements that resist only their change of volume, over its modulus.
        of_overlaid, of_others, of_volume: sentences on twins with and without such elements, and on a volume term.
    """

    names: Mapping[str, str]
    overlaid: frozenset[str]
    control: Callable[[Floats, Floats], Floats] | None
    least_shear: float
    of_overlaid: Sequence[str]
    of_others: Sequence[str]
    of_volume: Sequence[str]


@dataclass(frozen=True)
class Dialect:
    """The differences between the programs that read keyword decks.

    Attributes:
        program: name of the program.
        nonlinear: keyword parameter for geometric nonlinearity, for headers.
        force_unit: unit of force [N]; stiffness, stress and density are scaled by it.
        opening: returns the lines before the nodes, given the header.
        start: returns the lines that start a step; the second argument is True for geometric nonlinearity.
        output: returns the output requests; the argument is True for a continuum.
        explained: returns sentences on how to run a file, its units and its results, given its name and unit of force.
        of_elements: sentences on the finite elements.
        twin_unit: returns the unit of force [N] of a deck whose stiffest material has a modulus [Pa].
        solids: the types of hyperelastic elements.
        of_elastic: sentences on elements of *ELASTIC as a twin of biquadratic springs.
    """

    program: str
    nonlinear: str
    force_unit: float
    opening: Callable[[Sequence[str]], list[str]]
    start: Callable[[Step, bool], list[str]]
    output: Callable[[bool], list[str]]
    explained: Callable[[str, float], Sequence[str]]
    of_elements: Sequence[str]
    twin_unit: Callable[[float], float]
    solids: Solids
    of_elastic: Sequence[str]


class OwnLoad(NamedTuple):
    """A *DLOAD: element or set, type, magnitude at full load, and further fields."""

    on: str
    type: str
    size: float
    further: str = ""


@dataclass(frozen=True, eq=False)
class Twin:
    """The body of a deck.

    Attributes:
        nodes: undeformed positions [m], shape (n_nodes, dim).
        model: the lines of elements, materials and springs.
        loading: supports and nodal forces.
        own: loads given as *DLOAD.
        aside: displacement of unsupported nodes before the first level [m], shape of `nodes`; empty if there are none.
        for_good: boundary lines that hold at all levels.
    """

    nodes: Floats
    model: list[str]
    loading: Loading
    own: list[OwnLoad] = field(default_factory=list)
    aside: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    for_good: list[str] = field(default_factory=list)


def real(value: float) -> str:
    """Format a number with at most 19 characters: CalculiX reads twenty and ignores the rest.

    The text always has a decimal point; without one, a stiffness would be read as a direction.
    """
    text = f"{value:.12e}"
    return text if len(text) < 20 else f"{value:.11e}"


def joined(values: Iterable[object]) -> str:
    """Return values as a line, separated by commas."""
    return ", ".join(map(str, values))


def deck(
    dialect: Dialect, twin: Twin, levels: Sequence[float], nonlinear: bool, continuum: bool, header: Sequence[str]
) -> str:
    """Return a deck with one step for each load level; each step gives the total loads and displacements."""
    levels = list(levels)
    if not levels or levels[0] <= 0 or levels[-1] > 1 or any(b <= a for a, b in itertools.pairwise(levels)):
        raise ExportError(f"levels = {levels}: load factors must be ascending, above 0 and at most 1")
    lines = [
        *dialect.opening(header),
        "*NODE, NSET=NALL",
        *(f"{number}, {joined(map(real, node))}" for number, node in enumerate(twin.nodes.tolist(), 1)),
        *twin.model,
        *number_set("NSET", "HELD", np.flatnonzero(twin.loading.held.any(axis=1))),
    ]
    if twin.aside.any():
        lines += [*dialect.start(Step(0, _NO_TIME, _NO_TIME), nonlinear), *_led_aside(twin), "*END STEP"]
    for number, (last, level) in enumerate(itertools.pairwise([0.0, *levels]), 1):
        step = Step(number, level - last, min(level - last, _LARGEST_INCREMENT))
        lines += [
            f"** Step {number}: load factor {level:.9g}",
            *dialect.start(step, nonlinear),
            *_acting(twin, level, dialect.force_unit, anew=number == 1 and bool(twin.aside.any())),
            *(dialect.output(continuum) if number == 1 else []),  # also holds for later steps
            "*END STEP",
        ]
    return "\n".join([*lines, ""])


def _led_aside(twin: Twin) -> Iterator[str]:
    """Yield the boundary lines of the step that displaces unsupported nodes."""
    yield "** Nodes with a direction in which no spring acts at rest are displaced along their load, and released in "
    yield "** the next step: Newton's method cannot start from a singular matrix."
    yield "*BOUNDARY"
    for node, axis in np.argwhere(twin.loading.held | (twin.aside != 0)).tolist():
        yield f"{node + 1}, {axis + 1}, {axis + 1}, {real(twin.aside[node, axis])}"


def _acting(twin: Twin, level: float, force_unit: float, anew: bool) -> Iterator[str]:
    """Yield the supports and loads at a level, as totals; with `anew`, boundary conditions of earlier steps end."""
    motion, force = twin.loading.motion(level), twin.loading.dead_force(level) / force_unit
    yield "*BOUNDARY, OP=NEW" if anew else "*BOUNDARY"
    yield from twin.for_good if anew else []
    for node, axis in np.argwhere(twin.loading.held).tolist():
        yield f"{node + 1}, {axis + 1}, {axis + 1}, {real(motion[node, axis])}"
    if force.any():
        yield "*CLOAD"
        for node, axis in np.argwhere(force).tolist():
            yield f"{node + 1}, {axis + 1}, {real(force[node, axis])}"
    if twin.own:
        yield "*DLOAD"
        yield from (f"{one.on}, {one.type}, {real(level * one.size)}{one.further}" for one in twin.own)


def number_set(kind: str, name: str, numbers: Ints) -> Iterator[str]:
    """Yield the lines of a set of nodes (NSET) or elements (ELSET); `numbers` count from 0."""
    yield f"*{kind}, {kind}={name}"
    for first in range(0, len(numbers), _A_LINE):
        yield joined(numbers[first : first + _A_LINE] + 1)


def described(exported: Exported, what: str, springs: bool) -> list[str]:
    """Return the header of a deck: title, elements and problem; for springs also the expected result."""
    title, note = printable([exported.title, exported.note])
    if springs:
        return [
            title,
            f"{what}: {exported.written}",
            *([note] if note else []),
            *exported.stated,
            *exported.expectations,
        ]
    return [title, f"{what}, written by truespring {version('truespring')}.", *exported.stated]


def comments(header: Sequence[str]) -> list[str]:
    """Return sentences as comment lines, wrapped to the line length that both programs accept."""
    return [f"** {part}" for line in header for part in textwrap.wrap(line, 112, subsequent_indent="   ")]


def levels_of(exported: Exported) -> list[float]:
    """Return the load levels of the study."""
    return [(number + 1) / exported.load_steps for number in range(exported.load_steps)]
