"""The springs and elements of a body as groups of arrays, for the data of the C runtime."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from math import comb, factorial
from types import MappingProxyType
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ExportError
from truespring.exports.exported import Exported
from truespring.mesh import Mesh
from truespring.models.spring_data import COUPLING, PRESSURE, VOLUME_TERM, PlainSprings

#: Numbers of kinds, laws and forms as in truespring.h.
SPRINGS, PULLS, VOLUMES, COUPLED, POINTS, FIBRES = 1, 2, 3, 4, 5, 6
_NEO_HOOKEAN, _KAPPA, _POLYNOMIAL, _GENT = 0, 1, 2, 3
_BY_SIMPLICES = 0
_CLOSED_FORMS = MappingProxyType({"hexahedron": 1, "quadrilateral": 2})

# Coefficients of the series of Arruda and Boyce 1993, of I1b^i - 3^i.
_SERIES = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
# Matrices that differ by less than this share of their largest entry are equal.
_ALIKE = 1e-14

_NONE = np.zeros((0, 2), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Group:
    """Springs or elements of one kind.

    Attributes:
        kind: number of the kind.
        nodes: nodes of each, shape (n, corners).
        values: further arrays in the order of the file [SI].
        law: number of the law; of springs 0, or the dimension in the law neo-hookean.
        sheet: whether it is in plane stress.
        form: how a volume is computed.
        scale: factor of the determinants of simplices [-] or [m].
        simplices: local nodes, shape (n, dim + 1).
        links: pairs of local nodes, shape (n, 2).
        points: number of points of integration of an element.
        matrices: number of matrices or of rows of weights: 1 if they are those of all elements.
    """

    kind: int
    nodes: Ints
    values: tuple[Floats, ...]
    law: int = 0
    sheet: bool = False
    form: int = _BY_SIMPLICES
    scale: float = 0.0
    simplices: Ints = field(default_factory=lambda: _NONE)
    links: Ints = field(default_factory=lambda: _NONE)
    points: int = 0
    matrices: int = 0


def groups_of(exported: Exported) -> Iterator[Group]:
    """Yield the groups of an exported model; raise ExportError for a law that is not in truespring.h."""
    yield from _BY_FEATURE[exported.springs.beyond](exported)


def _plain(exported: Exported) -> Iterator[Group]:
    network = exported.network
    yield _springs(network)


def _springs(network: PlainSprings) -> Group:
    law = 0 if network.pair_law.linear else network.nodes.shape[1]
    if not network.pair_law.linear and network.law != "neo-hookean":
        raise ExportError(f"the force law '{network.law}' is not in truespring.h: use straight or neo-hookean")
    return Group(SPRINGS, network.springs, (network.stiffness, network.rest_length), law)


def _with_volume_term(exported: Exported) -> Iterator[Group]:
    yield from _plain(exported)
    kappa = exported.springs.arrays["kappa"]
    for numbers, block in exported.problem.mesh.blocks:
        volume = _thickness(exported) * block.measures
        yield Group(VOLUMES, block.elements, (volume, kappa[numbers]), _KAPPA, **_shape(block, _thickness(exported)))


def _thickness(exported: Exported) -> float:
    section = exported.problem.section
    return 1.0 if section is None else section.thickness


def _shape(block: Mesh, thickness: float) -> dict[str, Any]:
    """Return how the volume of the elements of one kind is computed."""
    form, kind = _CLOSED_FORMS.get(block.element, _BY_SIMPLICES), block.kind
    if form:
        return {"form": form, "scale": thickness}
    scale = thickness * kind.simplex_weight / factorial(kind.dim)
    return {"scale": scale, "simplices": np.array(kind.simplices)}


def _by_kind(exported: Exported) -> Iterator[tuple[Mesh, Mapping[str, Any]]]:
    """Yield the elements of each kind, and their arrays by name without the suffix of the kind."""
    arrays, blocks = exported.springs.arrays, exported.problem.mesh.blocks
    for _, block in blocks:
        suffix = f"_{block.element}" if len(blocks) > 1 else ""
        own = {name.removesuffix(suffix): value for name, value in arrays.items() if name.endswith(suffix)}
        yield block, own | {"law": arrays.get("law")}


def _coupled(exported: Exported) -> Iterator[Group]:
    for block, own in _by_kind(exported):
        coupling = np.asarray(own["coupling"])
        if np.abs(coupling - coupling[:1]).max() <= _ALIKE * np.abs(coupling).max():
            coupling = coupling[:1]
        links = np.asarray(own["links"])
        yield Group(COUPLED, block.elements, (coupling,), links=links, matrices=len(coupling))


def _gaussian(exported: Exported) -> Iterator[Group]:
    arrays = exported.springs.arrays
    if arrays["law"] == "neo-hookean":
        yield Group(PULLS, arrays["springs"], (arrays["stiffness"],))
    section = exported.problem.section
    sheet = section is not None and section.free_thickness
    if "gradients" in arrays:
        yield from _second_order(arrays, sheet)
        return
    for block, own in _by_kind(exported):
        law, constants = _law(own)
        links = np.asarray(own["links"]) if "link_weights" in own else _NONE
        values = (own["volume"], constants, own.get("link_weights", np.zeros(0)))
        shape = _shape(block, _thickness(exported))
        yield Group(VOLUMES, block.elements, values, law, sheet, links=links, **shape)
        for weights in own.get("fibre_weights", ()):
            of_fibres = (own["volume"], np.stack([own["k1"], own["k2"]], axis=1), weights)
            yield Group(FIBRES, block.elements, of_fibres, links=np.asarray(own["links"]), matrices=len(block.elements))


def _law(own: Mapping[str, Any]) -> tuple[int, Floats]:
    """Return the number of the law of Gaussian springs, and the constants of each element, shape (n, n_constants)."""
    if own["law"] not in _LAWS:
        raise ExportError(f"the law '{own['law']}' is not in truespring.h; allowed: {', '.join(_LAWS)}")
    number, constants = _LAWS[own["law"]]
    return number, np.stack(np.broadcast_arrays(*constants(own)), axis=1)


def _bulk(own: Mapping[str, Any]) -> Floats:
    return np.asarray(own["lam"] + 2 / 3 * own["mu"])


def _yeoh(own: Mapping[str, Any]) -> tuple[Floats, ...]:
    nothing = np.zeros_like(own["mu"])
    return _bulk(own), own["mu"] / 2, own["c20"], own["c30"], nothing, nothing


def _arruda_boyce(own: Mapping[str, Any]) -> tuple[Floats, ...]:
    """Return the series in I1b as a polynomial of I1b - 3."""
    N = np.asarray(own["locking_stretch"]) ** 2
    series = [c / N ** (i - 1) for i, c in enumerate(_SERIES, start=1)]
    m = own["mu"] / sum(2 * i * c * 3 ** (i - 1) for i, c in enumerate(series, start=1))
    powers = [
        sum(m * c * comb(i, j) * 3.0 ** (i - j) for i, c in enumerate(series, start=1) if i >= j) for j in range(1, 6)
    ]
    return _bulk(own), *(np.asarray(one) for one in powers)


#: Number and constants of the laws of Gaussian springs.
_LAWS: Mapping[str, tuple[int, Callable[[Mapping[str, Any]], tuple[Floats, ...]]]] = MappingProxyType(
    {
        "neo-hookean": (_NEO_HOOKEAN, lambda own: (own["mu"], own["lam"])),
        "yeoh": (_POLYNOMIAL, _yeoh),
        "arruda-boyce": (_POLYNOMIAL, _arruda_boyce),
        "gent": (_GENT, lambda own: (_bulk(own), own["mu"], own["jm"])),
    }
)


def _second_order(arrays: Mapping[str, Any], sheet: bool) -> Iterator[Group]:
    """Yield the points of elements of second order, and the fibres there as quadratic forms."""
    elements, gradients, volume = (np.asarray(arrays[name]) for name in ("all_elements", "gradients", "point_volume"))
    n, n_points, corners, dim = gradients.shape
    padded = np.zeros((n, n_points, corners, 3))
    padded[..., :dim] = gradients
    constants = np.stack([arrays["mu"], arrays["lam"]], axis=1)
    yield Group(POINTS, elements, (volume, constants, padded), sheet=sheet, points=n_points)
    for directions in arrays.get("fibre_directions", ()):
        along = np.einsum("epaj,ej->epa", gradients, directions)
        links = np.array([*combinations(range(corners), 2)])
        # sum of g_a x_a squared is minus the sum over pairs of g_a g_b |x_a - x_b|^2, as the g_a add up to zero
        weights = -volume[:, :, None] * along[:, :, links[:, 0]] * along[:, :, links[:, 1]]
        k1, k2 = (np.repeat(arrays[name], n_points) for name in ("k1", "k2"))
        values = (volume.reshape(-1), np.stack([k1, k2], axis=1), weights.reshape(n * n_points, -1))
        yield Group(FIBRES, np.repeat(elements, n_points, axis=0), values, links=links, matrices=n * n_points)


_BY_FEATURE: Mapping[str, Callable[[Exported], Iterator[Group]]] = MappingProxyType(
    {"": _plain, VOLUME_TERM: _with_volume_term, COUPLING: _coupled, PRESSURE: _gaussian}
)
