"""The body of a problem as finite elements of keyword decks, for CalculiX and Abaqus."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Loading
from truespring.errors import ExportError
from truespring.exports.decks import OwnLoad, Twin, joined, number_set, real
from truespring.exports.features import refuse_fibres, refuse_unwritten
from truespring.loading import Body, BodyForce, FacePressure, Load, nodal_force
from truespring.mesh import Mesh, plural
from truespring.mesh.facets import facet_keys
from truespring.mesh.files.inp_elements import FACES
from truespring.models import Fem
from truespring.models.quadratic import QuadraticPotential
from truespring.problem import Problem

_SOLIDS = {"tetrahedron": "C3D4", "pyramid": "C3D8", "wedge": "C3D8", "hexahedron": "C3D8"}
# CalculiX has no pyramids, and integrates wedges (C3D6) at two points. Collapsed bricks are equal to truespring's
# elements: pyramids exactly, wedges up to quadrature at large strain.
AS_BRICKS = ("pyramid", "wedge")
BRICKS_EXPLAINED = "** Wedges and pyramids are written as collapsed bricks: some of their corners are the same node."
_PLANES = {"triangle": "3", "quadrilateral": "4"}
# Types of second-order elements.
_SECOND_ORDER = {"triangle": "6", "tetrahedron": "C3D10"}

#: Interpolations that both programs support: first order, fully integrated, and second order on simplices.
ELEMENTS = ("linear", "quadratic")


def fem_twin(problem: Problem, law: str, force_unit: float, element: str = "linear") -> Twin:
    """Return the body as first-order finite elements, or second-order ("quadratic") triangles and tetrahedra.

    Pressure and gravity are *DLOAD, other loads are nodal forces; on quadratic elements gravity is nodal forces too.
    Raises ExportError if the problem is not supported.
    """
    check_fem(problem, law, element)
    nodes, blocks = problem.mesh.nodes, element_blocks(problem)
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
    bricks = any(kind in AS_BRICKS for kind in problem.mesh.element_kinds)
    lines = [BRICKS_EXPLAINED] if bricks else []
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
        return " and ".join(dict.fromkeys(kind for kind, _, _ in element_blocks(problem)))
    name = _SECOND_ORDER[problem.mesh.element]
    return name if problem.mesh.dim == 3 else _plane(problem) + name


def _plane(problem: Problem) -> str:
    return "" if problem.section is None else problem.section.elements


def element_blocks(problem: Problem) -> list[tuple[str, Ints, Ints]]:
    """Return type, numbers and nodes of the first-order elements, for each kind."""
    found = []
    for numbers, part in problem.mesh.blocks:
        kind = _SOLIDS[part.element] if part.element in _SOLIDS else _plane(problem) + _PLANES[part.element]
        bricks = part.element in AS_BRICKS
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
        bricks = part.element in AS_BRICKS
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
