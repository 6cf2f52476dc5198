"""Keyword decks for CalculiX and Abaqus, which read the same keywords; a Dialect holds the differences.

Decks count nodes and elements from 1: node i of truespring is node i + 1.
Source: CalculiX CrunchiX User's Manual, https://www.dhondt.de; Abaqus Keywords Reference.
"""

import itertools
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Loading
from truespring.errors import ExportError
from truespring.exports.exported import Exported, printable
from truespring.exports.features import Feature, refuse_fibres, refuse_others, refuse_unwritten
from truespring.loading import Body, BodyForce, FacePressure, Load, nodal_force
from truespring.mesh import Mesh, plural
from truespring.mesh.facets import facet_keys
from truespring.mesh.files.inp_elements import FACES
from truespring.models import Fem
from truespring.models.quadratic import QuadraticPotential
from truespring.models.spring_data import PlainSprings
from truespring.problem import Problem

#: Writes results only of the last increment of a step.
LAST_ONLY = "FREQUENCY=1000000"

#: Features that SPRINGA elements support. Their rest length is the distance of their nodes.
SPRINGA = frozenset({Feature.NEGATIVE})

# Limit of the first increment, as a share of the full load: larger ones may converge to another equilibrium.
_LARGEST_INCREMENT = 0.25
# Period of a step that is not a load level.
_NO_TIME = 1e-9
# Offset of unsupported nodes, as a share of their longest spring; stiffness below which a direction is unsupported, as
# a share of the largest.
_ASIDE, _LOOSE = 1e-2, 1e-9
# Numbers per line.
_A_LINE = 16

_SOLIDS = {"tetrahedron": "C3D4", "pyramid": "C3D8", "wedge": "C3D8", "hexahedron": "C3D8"}
# CalculiX has no pyramids, and integrates wedges (C3D6) at two points. Collapsed bricks are equal to truespring's
# elements: pyramids exactly, wedges up to quadrature at large strain.
_AS_BRICKS = ("pyramid", "wedge")
_BRICKS_EXPLAINED = "** Wedges and pyramids are written as collapsed bricks: some of their corners are the same node."
_PLANES = {"triangle": "3", "quadrilateral": "4"}
# Types of second-order elements.
_SECOND_ORDER = {"triangle": "6", "tetrahedron": "C3D10"}

#: Interpolations that both programs support: first order, fully integrated, and second order on simplices.
ELEMENTS = ("linear", "quadratic")


class Step(NamedTuple):
    """A step: its number from 1, its increase of the load factor, and the first increment of that.

    Time is the load factor in all decks, so results are labelled with their level.
    """

    number: int
    period: float
    first_increment: float


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
        explained: returns sentences on how to run a file, its units and its results, given its name.
        of_elements: sentences on the finite elements.
    """

    program: str
    nonlinear: str
    force_unit: float
    opening: Callable[[Sequence[str]], list[str]]
    start: Callable[[Step, bool], list[str]]
    output: Callable[[bool], list[str]]
    explained: Callable[[str], Sequence[str]]
    of_elements: Sequence[str]


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


# --- the continuum -------------------------------------------------------------------------------


def fem_twin(problem: Problem, law: str, force_unit: float, element: str = "linear") -> Twin:
    """Return the body as first-order finite elements, or second-order ("quadratic") triangles and tetrahedra.

    Pressure and gravity are *DLOAD, other loads are nodal forces; on quadratic elements gravity is nodal forces too.
    Raises ExportError if the problem is not supported.
    """
    check_fem(problem, law, element)
    nodes, blocks = problem.mesh.nodes, _blocks(problem)
    finer = second_order(problem, element)
    own: list[Load] = []
    on_nodes: list[Load] = []
    for load in problem.loads:
        by_program = load.cards(problem.mesh) and (finer is None or load.follows)
        (own if by_program else on_nodes).append(load)
    if finer is None:
        loading = _on_nodes(problem.loading, on_nodes, problem.body, nodes)
    else:
        nodes, blocks = finer.nodes, [(fem_element(problem, element), np.arange(len(finer.elements)), finer.elements)]
        loading = _on_nodes(finer.loading, on_nodes, finer.body, nodes)
    bricks = any(kind in _AS_BRICKS for kind in problem.mesh.element_kinds)
    lines = [_BRICKS_EXPLAINED] if bricks else []
    for kind, numbers, elements in blocks:
        lines.append(f"*ELEMENT, TYPE={kind}, ELSET=BODY")
        rows = np.column_stack([numbers, elements]) + 1
        lines += map(joined, rows.tolist())
    for number in range(len(problem.materials)):
        lines += _material(problem, number, force_unit)
    return Twin(nodes, lines, loading, [line for load in own for line in _dload(problem.mesh, load, force_unit)])


def usual_element(problem: Problem) -> str:
    """Return the default interpolation: "quadratic" on triangles and tetrahedra, as for Fem, else "linear"."""
    return "quadratic" if problem.mesh.element in _SECOND_ORDER else "linear"


def second_order(problem: Problem, element: str) -> QuadraticPotential | None:
    """Return the potential of second-order elements, whose nodes the deck shares; None for "linear"."""
    finer = Fem("linear", element).potential(problem)
    return finer if isinstance(finer, QuadraticPotential) else None


def check_fem(problem: Problem, law: str, element: str = "linear") -> None:
    """Raise ExportError for no continuum, an unknown `element`, and what decks of finite elements do not support."""
    if problem.material is None or problem.section is None:
        raise ExportError("a spring network has no continuum: finite elements need a mesh of elements and a material")
    refuse_fibres(problem, "decks of finite elements")
    refuse_unwritten(problem, "decks of finite elements")
    for load in problem.loads:
        if law != "linear" and load.follows and not load.cards(problem.mesh):
            raise ExportError(
                f"{load.words()} follows the body, and there is no keyword for it: use {load.instead} instead, or the "
                "linear law, where it is nodal forces"
            )
    if element not in ELEMENTS or (element == "quadratic" and problem.mesh.element not in _SECOND_ORDER):
        raise ExportError(
            f"element = '{element}' is not available for a mesh of {problem.mesh.element} elements; allowed: "
            f'"linear" for all, "quadratic" for {" and ".join(map(plural, _SECOND_ORDER))}'
        )


def fem_element(problem: Problem, element: str = "linear") -> str:
    """Return the element types: CPS4, CPE4, CPS3, CPE3, C3D8 or C3D4; for "quadratic" CPS6, CPE6 or C3D10."""
    if element == "linear":
        return " and ".join(dict.fromkeys(kind for kind, _, _ in _blocks(problem)))
    name = _SECOND_ORDER[problem.mesh.element]
    return name if problem.mesh.dim == 3 else _plane(problem) + name


def _plane(problem: Problem) -> str:
    return "" if problem.section is None else problem.section.elements


def _blocks(problem: Problem) -> list[tuple[str, Ints, Ints]]:
    """Return type, numbers and nodes of the first-order elements, for each kind."""
    found = []
    for numbers, part in problem.mesh.blocks:
        kind = _SOLIDS[part.element] if part.element in _SOLIDS else _plane(problem) + _PLANES[part.element]
        bricks = part.element in _AS_BRICKS
        found.append((kind, numbers, part.elements[:, part.kind.merged] if bricks else part.elements))
    return found


def _material(problem: Problem, number: int, force_unit: float) -> Iterator[str]:
    """Yield the lines of a material and of its elements."""
    material, several = problem.materials[number], len(problem.materials) > 1
    name = f"PART{number + 1}" if several else "BODY"
    if several:
        yield from number_set("ELSET", name, np.flatnonzero(problem.material_numbers == number))
    yield f"*MATERIAL, NAME=M{number + 1}"
    yield "*ELASTIC"
    yield f"{real(material.young / force_unit)}, {real(material.poisson)}"
    if material.density is not None:
        yield "*DENSITY"
        yield real(material.density / force_unit)
    yield f"*SOLID SECTION, ELSET={name}, MATERIAL=M{number + 1}"
    if problem.mesh.dim == 2 and problem.section is not None:
        yield real(problem.section.thickness)


def _dload(mesh: Mesh, load: Load, force_unit: float) -> Iterator[OwnLoad]:
    """Yield the *DLOAD of a load: gravity, or pressure on faces, which follows them in nonlinear decks."""
    for card in load.cards(mesh):
        match card:
            case BodyForce(acceleration):
                size = float(np.linalg.norm(acceleration))
                direction = [*(acceleration / (size or 1.0)), 0.0][:3]
                yield OwnLoad("BODY", "GRAV", size, f", {joined(map(real, direction))}")
            case FacePressure(facets, pressure):
                for number, face, pressed in _faces(mesh, facets):
                    yield OwnLoad(str(number + 1), f"P{face}", float(pressure[pressed]) / force_unit)


def _faces(mesh: Mesh, facets: Ints) -> Iterator[tuple[int, int, int]]:
    """Yield element, face number from 1 and row in `facets`, for each element face that is one of `facets`."""
    keys = _face_keys(facets)
    for numbers, part in mesh.blocks:
        bricks = part.element in _AS_BRICKS
        nodes = part.elements[:, part.kind.merged] if bricks else part.elements
        for face, local in enumerate(FACES["hexahedron" if bricks else part.element], 1):
            places = _places(_face_keys(nodes[:, local]), keys)
            for element in np.flatnonzero(places >= 0).tolist():
                yield int(numbers[element]), face, int(places[element])


def _face_keys(faces: Ints) -> Ints:
    """Return a row for each face, equal for faces with the same corners."""
    padded = np.concatenate([faces, faces[:, -1:]], axis=1) if faces.shape[1] == len("abc") else faces
    return np.stack(facet_keys(padded.T), axis=1)


def _places(rows: Ints, others: Ints) -> Ints:
    """Return the index of each row in `others`, -1 if it is not there, shape (n_rows,)."""
    both = np.unique(np.concatenate([others, rows]), axis=0, return_inverse=True)[1].ravel()
    place = np.full(len(both), -1)
    place[both[: len(others)]] = np.arange(len(others))
    return np.asarray(place[both[len(others) :]])


def _on_nodes(loading: Loading, loads: Sequence[Load], body: Body, nodes: Floats) -> Loading:
    """Return the supports with `loads` as nodal forces; loads that follow the body act as on the undeformed body."""
    spreads = [load.spread(body) for load in loads]
    potentials = [load.following(body, loading.held) for load in loads]
    return replace(
        loading,
        external_force=nodal_force((one for one in spreads if one is not None), nodes.shape),
        following=tuple(one for one in potentials if one is not None),
    ).at_rest(nodes)


# --- springs -------------------------------------------------------------------------------------


def spring_twin(problem: Problem, network: PlainSprings, force_unit: float) -> Twin:
    """Return the springs as SPRINGA elements, one element set for each stiffness.

    Raises ExportError for features that are not in SPRINGA.
    """
    refuse_others(problem, network.spring_data(), SPRINGA, "a SPRINGA element")
    members: dict[str, list[int]] = {}
    for number, stiffness in enumerate((network.stiffness / force_unit).tolist()):
        members.setdefault(real(stiffness), []).append(number)
    lines: list[str] = []
    for group, (stiffness, numbers) in enumerate(members.items(), 1):
        lines.append(f"*ELEMENT, TYPE=SPRINGA, ELSET=S{group}")
        lines += (f"{number + 1}, {joined((network.springs[number] + 1).tolist())}" for number in numbers)
        lines += [f"*SPRING, ELSET=S{group}", "", stiffness]  # the blank line is for directions
    plane = ["NALL, 3, 3"] if network.nodes.shape[1] == 2 else []  # SPRINGA acts in 3D: hold z
    lines += ["*BOUNDARY", *plane] if plane else []
    aside = _aside(network, problem.loading)
    return Twin(network.nodes, lines, problem.loading, aside=aside, for_good=plane)


def is_led_aside(problem: Problem, network: PlainSprings) -> bool:
    """Return whether a deck of springs needs a step that displaces unsupported nodes before the first level."""
    return bool(_aside(network, problem.loading).any())


def _aside(network: PlainSprings, loading: Loading) -> Floats:
    """Return the offset of nodes with a free direction in which no spring acts at rest [m], shape (n_nodes, dim).

    The springs stiffen as the node moves, but Newton's method without line search cannot start at zero stiffness.
    """
    n_nodes, dim = network.nodes.shape
    ends = network.springs
    along = np.diff(network.nodes[ends], axis=1)[:, 0]
    length = np.linalg.norm(along, axis=1)
    along /= length[:, None]
    stiffness, reach = np.zeros((n_nodes, dim, dim)), np.zeros(n_nodes)
    for end in ends.T:
        np.add.at(stiffness, end, network.stiffness[:, None, None] * along[:, :, None] * along[:, None, :])
        np.maximum.at(reach, end, length)
    largest = float(np.abs(stiffness).max())
    free = ~loading.held
    stiffness = stiffness * free[:, :, None] * free[:, None, :] + largest * np.eye(dim) * loading.held[:, None, :]
    values, vectors = np.linalg.eigh(stiffness)
    loose = np.abs(values) <= _LOOSE * largest
    ways = np.where(loose[:, None, :], vectors, 0.0)  # as columns
    pulled = np.einsum("nai,nbi,nb->na", ways, ways, loading.external_force)
    size = np.linalg.norm(pulled, axis=1)
    idle = loose.any(axis=1) & (size == 0)
    pulled[idle] = ways[idle, :, :].sum(axis=2)
    size = np.linalg.norm(pulled, axis=1)
    share = np.divide(_ASIDE * reach, size, out=np.zeros(n_nodes), where=size > 0)
    return np.asarray(share[:, None] * pulled)


# --- the files of a target -------------------------------------------------------------------------


def deck_files(dialect: Dialect, exported: Exported) -> dict[str, str]:
    """Return `springs.inp`, and `fem.inp` if the problem has a continuum that the program supports."""
    problem, levels, files = exported.problem, levels_of(exported), {}
    notes = ["SPRINGA elements do not support prestress, volume terms, coupled springs and loads that follow a face."]
    try:
        check_fem(problem, "saint-venant-kirchhoff")
        element = usual_element(problem)
        twin = fem_twin(problem, "saint-venant-kirchhoff", dialect.force_unit, element)
        what = f"{dialect.program} {fem_element(problem, element)} elements, {dialect.nonlinear}"
        header = [*described(exported, what, springs=False), *dialect.explained("fem"), *dialect.of_elements]
        files["fem.inp"] = deck(dialect, twin, levels, nonlinear=True, continuum=True, header=header)
    except ExportError as error:
        notes.append(f"fem.inp was not written: {error}.")
    what = f"{dialect.program} SPRINGA elements"
    header = [*described(exported, what, springs=True), *dialect.explained("springs"), *notes]
    twin = spring_twin(problem, exported.network, dialect.force_unit)
    return {"springs.inp": deck(dialect, twin, levels, nonlinear=True, continuum=False, header=header), **files}


# --- headers -------------------------------------------------------------------------------------


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
