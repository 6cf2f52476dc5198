"""Decks of keywords: what those for CalculiX and for Abaqus have in common, which read the same ones.

Nodes and elements are counted from 1 there: node i of ours is node i + 1.
Source: the manual of CalculiX CrunchiX, https://www.dhondt.de, and the keywords reference of Abaqus.
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
from truespring.exports.features import Feature, refuse_others
from truespring.loading import Body, BodyForce, FacePressure, Load, nodal_force
from truespring.mesh import Mesh, plural
from truespring.mesh.facets import facet_keys
from truespring.mesh.files.inp_elements import FACES
from truespring.models import Fem
from truespring.models.quadratic import QuadraticPotential
from truespring.models.spring_data import PlainSprings
from truespring.problem import Problem

#: Of results of a step: the last increment is always written.
LAST_ONLY = "FREQUENCY=1000000"

#: What SPRINGA elements take beside springs at rest under dead loads: their length at rest is that of their nodes.
SPRINGA = frozenset({Feature.NEGATIVE})

# The first of several increments is at most this share of the full load: beyond the nearest equilibrium lie others.
_LARGEST_INCREMENT = 0.25
# How long a step is that is no load level.
_NO_TIME = 1e-9
# Nodes are led aside by this share of their longest spring; a stiffness below that share of the largest is none.
_ASIDE, _LOOSE = 1e-2, 1e-9
# Numbers in a line.
_A_LINE = 16

_SOLIDS = {"tetrahedron": "C3D4", "pyramid": "C3D8", "wedge": "C3D8", "hexahedron": "C3D8"}
# CalculiX has no pyramids, and integrates its wedges C3D6 at two points. As bricks with corners that are one they are
# the elements that they are here: pyramids to the digit, wedges to the quadrature of large strain.
_AS_BRICKS = ("pyramid", "wedge")
_BRICKS_EXPLAINED = "** Wedges and pyramids are bricks here, some of whose corners are one node."
_PLANES = {"triangle": "3", "quadrilateral": "4"}
# Of elements of second order.
_SECOND_ORDER = {"triangle": "6", "tetrahedron": "C3D10"}

#: Interpolations that both programs have: full integration of first order, and of second order on simplices.
ELEMENTS = ("linear", "quadratic")


class Step(NamedTuple):
    """A load level: its number from 1, the load factor that it adds, and how much of that its first increment does.

    Time is the load factor in all decks: a result knows its level.
    """

    number: int
    period: float
    first_increment: float


@dataclass(frozen=True)
class Dialect:
    """What a program wants otherwise than the others.

    Attributes:
        program: its name.
        nonlinear: how it is asked for geometric nonlinearity, for headers.
        force_unit: of all forces and what is made of them [N].
        opening: lines before the nodes, made of those of the header.
        start: lines that start a step, for one with or without geometric nonlinearity.
        output: lines that ask for results, for a continuum or for springs.
        explained: how to run a file of a name, its units and results, in sentences.
        of_elements: what its finite elements are, in sentences.
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
    """A load that the program spreads itself: on an element or a set, of a type, at full load, and what else it is."""

    on: str
    type: str
    size: float
    further: str = ""


@dataclass(frozen=True, eq=False)
class Twin:
    """A body as the program knows it.

    Attributes:
        nodes: [m], shape (n_nodes, dim).
        model: the lines of elements, materials and springs.
        loading: what acts on the nodes.
        own: what the program spreads.
        aside: how far nodes are led aside before the first level [m], of the shape of `nodes`; empty if they are not.
        for_good: boundary lines that hold at all levels.
    """

    nodes: Floats
    model: list[str]
    loading: Loading
    own: list[OwnLoad] = field(default_factory=list)
    aside: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    for_good: list[str] = field(default_factory=list)


def real(value: float) -> str:
    """Write a number in at most 19 characters: CalculiX reads twenty and silently drops the rest.

    It has a decimal point always: without one a stiffness would be read as a direction.
    """
    text = f"{value:.12e}"
    return text if len(text) < 20 else f"{value:.11e}"


def joined(values: Iterable[object]) -> str:
    """Write values in a line."""
    return ", ".join(map(str, values))


def deck(
    dialect: Dialect, twin: Twin, levels: Sequence[float], nonlinear: bool, continuum: bool, header: Sequence[str]
) -> str:
    """Write a deck of one step a load level, each with loads and motions in full."""
    levels = list(levels)
    if not levels or levels[0] <= 0 or levels[-1] > 1 or any(b <= a for a, b in itertools.pairwise(levels)):
        raise ExportError(f"levels = {levels}: load factors in ascending order are wanted, above 0 and at most 1")
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
            *(dialect.output(continuum) if number == 1 else []),  # goes on in the steps that follow
            "*END STEP",
        ]
    return "\n".join([*lines, ""])


def _led_aside(twin: Twin) -> Iterator[str]:
    """Boundary lines of a step before the first."""
    yield "** Nodes that no spring holds at rest are led aside, along their load, and let go in the step that follows."
    yield "*BOUNDARY"
    for node, axis in np.argwhere(twin.loading.held | (twin.aside != 0)).tolist():
        yield f"{node + 1}, {axis + 1}, {axis + 1}, {real(twin.aside[node, axis])}"


def _acting(twin: Twin, level: float, force_unit: float, anew: bool) -> Iterator[str]:
    """Supports and loads at a level: amounts in full, which replace those of the step before; `anew` all of them."""
    motion, force = twin.loading.motion(level), level * twin.loading.external_force / force_unit
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
    """Write a set of nodes (NSET) or elements (ELSET), given by our numbers."""
    yield f"*{kind}, {kind}={name}"
    for first in range(0, len(numbers), _A_LINE):
        yield joined(numbers[first : first + _A_LINE] + 1)


# --- the continuum -------------------------------------------------------------------------------


def fem_twin(problem: Problem, law: str, force_unit: float, element: str = "linear") -> Twin:
    """Return the body as finite elements of first order, or of the second ("quadratic") on triangles and tetrahedra.

    Pressure and gravity are the program's own, other loads come as forces on nodes; on quadratic elements gravity too.
    Raises ExportError for what cannot be said.
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
    """Return the interpolation that is the default: that of our own elements, where the programs have it."""
    return "quadratic" if problem.mesh.element in _SECOND_ORDER else "linear"


def second_order(problem: Problem, element: str) -> QuadraticPotential | None:
    """Return our own elements of second order, whose nodes the program has too; None where it is of the first."""
    finer = Fem("linear", element).potential(problem)
    return finer if isinstance(finer, QuadraticPotential) else None


def check_fem(problem: Problem, law: str, element: str = "linear") -> None:
    """Raise ExportError where a problem has no continuum, a load that none can have, or no such elements."""
    if problem.material is None or problem.section is None:
        raise ExportError("a plain network of springs has no continuum: give its mesh elements and a material")
    for load in problem.loads:
        if law != "linear" and load.follows and not load.cards(problem.mesh):
            raise ExportError(
                f"{load.words()} follows the body, and no keyword has it: use {load.instead} instead, or the linear "
                "law, where it is forces on nodes"
            )
    if element not in ELEMENTS or (element == "quadratic" and problem.mesh.element not in _SECOND_ORDER):
        raise ExportError(
            f"element = '{element}' cannot be written for a mesh of {problem.mesh.element} elements: \"linear\" is for "
            f'all, "quadratic" for {" and ".join(map(plural, _SECOND_ORDER))}'
        )


def fem_element(problem: Problem, element: str = "linear") -> str:
    """Return the types of the elements: CPS4, CPE4, CPS3, CPE3, C3D8 or C3D4; "quadratic" CPS6, CPE6 or C3D10."""
    if element == "linear":
        return " and ".join(dict.fromkeys(kind for kind, _, _ in _blocks(problem)))
    name = _SECOND_ORDER[problem.mesh.element]
    return name if problem.mesh.dim == 3 else _plane(problem) + name


def _plane(problem: Problem) -> str:
    return "" if problem.section is None else problem.section.elements


def _blocks(problem: Problem) -> list[tuple[str, Ints, Ints]]:
    """The elements of first order by their types: their numbers and nodes."""
    found = []
    for numbers, part in problem.mesh.blocks:
        kind = _SOLIDS[part.element] if part.element in _SOLIDS else _plane(problem) + _PLANES[part.element]
        bricks = part.element in _AS_BRICKS
        found.append((kind, numbers, part.elements[:, part.kind.merged] if bricks else part.elements))
    return found


def _material(problem: Problem, number: int, force_unit: float) -> Iterator[str]:
    """The material of a number and the elements that have it."""
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
    """Yield the *DLOAD of a load: weight, or pressure on faces, which follows them in nonlinear decks."""
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
    """Yield the element, the number of its face from 1, and the facet that this is, for all that are `facets`."""
    keys = _face_keys(facets)
    for numbers, part in mesh.blocks:
        bricks = part.element in _AS_BRICKS
        nodes = part.elements[:, part.kind.merged] if bricks else part.elements
        for face, local in enumerate(FACES["hexahedron" if bricks else part.element], 1):
            places = _places(_face_keys(nodes[:, local]), keys)
            for element in np.flatnonzero(places >= 0).tolist():
                yield int(numbers[element]), face, int(places[element])


def _face_keys(faces: Ints) -> Ints:
    """Rows of numbers that are equal for faces of the same corners, as long as those of a face can be."""
    padded = np.concatenate([faces, faces[:, -1:]], axis=1) if faces.shape[1] == len("abc") else faces
    return np.stack(facet_keys(padded.T), axis=1)


def _places(rows: Ints, others: Ints) -> Ints:
    """Return the place of each row of numbers among the others, -1 where it is not there, shape (n_rows,)."""
    both = np.unique(np.concatenate([others, rows]), axis=0, return_inverse=True)[1].ravel()
    place = np.full(len(both), -1)
    place[both[: len(others)]] = np.arange(len(others))
    return np.asarray(place[both[len(others) :]])


def _on_nodes(loading: Loading, loads: Sequence[Load], body: Body, nodes: Floats) -> Loading:
    """Return supports with loads as forces on nodes: those that follow the body act as on the undeformed one."""
    spreads = [load.spread(body) for load in loads]
    potentials = [load.following(body, loading.held) for load in loads]
    return replace(
        loading,
        external_force=nodal_force((one for one in spreads if one is not None), nodes.shape),
        following=tuple(one for one in potentials if one is not None),
    ).at_rest(nodes)


# --- springs -------------------------------------------------------------------------------------


def spring_twin(problem: Problem, network: PlainSprings, force_unit: float) -> Twin:
    """Return every spring as a SPRINGA element, one set of elements for each stiffness as it is written.

    Raises ExportError for what such elements are not: see SPRINGA.
    """
    refuse_others(problem, network.spring_data(), SPRINGA, "a SPRINGA element")
    members: dict[str, list[int]] = {}
    for number, stiffness in enumerate((network.stiffness / force_unit).tolist()):
        members.setdefault(real(stiffness), []).append(number)
    lines: list[str] = []
    for group, (stiffness, numbers) in enumerate(members.items(), 1):
        lines.append(f"*ELEMENT, TYPE=SPRINGA, ELSET=S{group}")
        lines += (f"{number + 1}, {joined((network.springs[number] + 1).tolist())}" for number in numbers)
        lines += [f"*SPRING, ELSET=S{group}", "", stiffness]  # the empty line stands for directions
    plane = ["NALL, 3, 3"] if network.nodes.shape[1] == 2 else []  # these springs are in space: it is held in z
    lines += ["*BOUNDARY", *plane] if plane else []
    aside = _aside(network, problem.loading)
    return Twin(network.nodes, lines, problem.loading, aside=aside, for_good=plane)


def is_led_aside(problem: Problem, network: PlainSprings) -> bool:
    """Whether a deck of springs has a step before the first level."""
    return bool(_aside(network, problem.loading).any())


def _aside(network: PlainSprings, loading: Loading) -> Floats:
    """How far nodes are led aside that springs do not hold at rest in a free direction [m], shape (n_nodes, dim).

    Such springs stiffen as the node moves, but Newton's method of a program that has no line search cannot begin.
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
    """Return `springs.inp`, and `fem.inp` where the problem has a continuum that the program can express."""
    problem, levels, files = exported.problem, levels_of(exported), {}
    notes = [
        "Prestress, volume terms, coupled springs and loads that follow a face have no place among SPRINGA elements."
    ]
    try:
        check_fem(problem, "saint-venant-kirchhoff")
        element = usual_element(problem)
        twin = fem_twin(problem, "saint-venant-kirchhoff", dialect.force_unit, element)
        what = f"{dialect.program} {fem_element(problem, element)} elements, {dialect.nonlinear}"
        header = [*described(exported, what, springs=False), *dialect.explained("fem"), *dialect.of_elements]
        files["fem.inp"] = deck(dialect, twin, levels, nonlinear=True, continuum=True, header=header)
    except ExportError as error:
        notes.append(f"There is no fem.inp beside this file: {error}.")
    what = f"{dialect.program} SPRINGA elements"
    header = [*described(exported, what, springs=True), *dialect.explained("springs"), *notes]
    twin = spring_twin(problem, exported.network, dialect.force_unit)
    return {"springs.inp": deck(dialect, twin, levels, nonlinear=True, continuum=False, header=header), **files}


# --- headers -------------------------------------------------------------------------------------


def described(exported: Exported, what: str, springs: bool) -> list[str]:
    """Return what a deck is, and what the problem asks; of springs also what to expect of them."""
    title, note = printable([exported.title, exported.note])
    if springs:
        return [
            title,
            f"{what}: {exported.written}",
            *([note] if note else []),
            *exported.asked,
            *exported.told_of_springs,
        ]
    return [title, f"{what}, written by truespring {version('truespring')}.", *exported.asked]


def comments(header: Sequence[str]) -> list[str]:
    """Write sentences as comment lines, short enough for every program."""
    return [f"** {part}" for line in header for part in textwrap.wrap(line, 112, subsequent_indent="   ")]


def levels_of(exported: Exported) -> list[float]:
    """Return the load levels that the study asks for."""
    return [(number + 1) / exported.load_steps for number in range(exported.load_steps)]
