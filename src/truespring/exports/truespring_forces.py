"""Energy, forces and tangent stiffness of exported springs, by NumPy alone.

Springs, springs with a volume term, biquadratic springs, and neo-Hookean Gaussian springs of first and second order,
from the arrays of springs.npz, which docs/export/arrays.md of truespring describes. Units are SI.

    forces = Forces(dict(numpy.load("springs.npz")))
    f = -forces.gradient(x)    # x: positions of all nodes [m], shape (n_nodes, dim)
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
#: Node numbers of each element, shape (n, k), and its energy gradient and second derivatives by node and direction.
Parts = tuple[Ints, Floats, Floats]

# Iterations of Newton's method for the thickness in plane stress.
_ITERATIONS = 50


class Forces:
    """The potential of exported springs.

    Attributes:
        nodes: undeformed positions of all nodes [m], shape (n_nodes, dim).
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Take the arrays of springs.npz by name."""
        self.nodes: Floats = np.asarray(values.get("all_nodes", values["nodes"]), dtype=float)
        self._terms: list[Any] = []
        if "stiffness" in values:
            self._terms.append(_Springs(values))
        if any(name.startswith("coupling") for name in values):
            self._terms += [_Coupled(values, kind) for kind in _kinds(values, "coupling")]
        elif "gradients" in values:
            self._terms.append(_Points(values))
        elif "lam" in values or any(name.startswith("lam_") for name in values):
            self._terms += [_Volumes.gaussian(values, kind) for kind in _kinds(values, "lam")]
        elif "kappa" in values:
            self._terms += _Volumes.of_term(values)

    def energy(self, x: Floats) -> float:
        """Return the stored energy at positions of shape (n_nodes, dim) [J]; NaN if an element is inverted."""
        return float(sum(term.energy(x) for term in self._terms))

    def gradient(self, x: Floats) -> Floats:
        """Return the internal forces [N], shape (n_nodes, dim); those on the nodes are minus these."""
        found = np.zeros_like(x)
        for term in self._terms:
            for elements, gradient, _ in term.parts(x, False):
                np.add.at(found, elements, gradient)
        return found

    def tangent(self, x: Floats) -> tuple[Ints, Ints, Floats]:
        """Return rows, columns and values [N/m] of the second derivatives of the energy, sums not yet taken.

        Row and column of node i in direction j are dim i + j.
        """
        rows, columns, values = [], [], []
        for term in self._terms:
            for elements, _, second in term.parts(x, True):
                n, k = elements.shape
                size = k * x.shape[1]
                place = (elements[:, :, None] * x.shape[1] + np.arange(x.shape[1])).reshape(n, size)
                rows.append(np.repeat(place, size, axis=1).ravel())
                columns.append(np.tile(place, (1, size)).ravel())
                values.append(second.reshape(-1))
        return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)

    def summed_tangent(self, x: Floats) -> tuple[Ints, Ints, Floats]:
        """Return the entries of `tangent`, each place once."""
        rows, columns, values = self.tangent(x)
        keys, place = np.unique(rows * x.size + columns, return_inverse=True)
        summed = np.bincount(place.ravel(), values, len(keys)).astype(np.float64)
        return keys // x.size, keys % x.size, summed


def _kinds(values: Mapping[str, Any], name: str) -> list[str]:
    """Return the suffixes of the kinds of elements that have an array `name`: "" alone, or "_triangle" and so on."""
    return [""] if name in values else [key.removeprefix(name) for key in values if key.startswith(f"{name}_")]


class _Springs:
    """Springs k (l - L), also of zero rest length."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._ends: Ints = np.asarray(values["springs"], dtype=np.int64)
        self._stiffness: Floats = np.asarray(values["stiffness"], dtype=float)
        self._rest: Floats = np.asarray(values["rest_length"], dtype=float)

    def _across(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the vector along each spring [m], and the share of its stiffness that it pulls with."""
        across = x[self._ends[:, 1]] - x[self._ends[:, 0]]
        length = np.linalg.norm(across, axis=1)
        shortened = np.divide(self._rest, length, out=np.zeros_like(length), where=self._rest > 0)
        return across, 1 - shortened

    def energy(self, x: Floats) -> float:
        length = np.linalg.norm(self._across(x)[0], axis=1)
        return float((self._stiffness / 2 * (length - self._rest) ** 2).sum())

    def parts(self, x: Floats, second: bool) -> Iterator[Parts]:
        across, share = self._across(x)
        pull = (self._stiffness * share)[:, None] * across
        gradient = np.stack([-pull, pull], axis=1)
        if not second:
            yield self._ends, gradient, np.zeros(0)
            return
        square = np.where(self._rest > 0, (across**2).sum(axis=1), 1.0)
        along = ((1 - share) / square)[:, None, None] * across[:, :, None] * across[:, None, :]
        block = self._stiffness[:, None, None] * (share[:, None, None] * np.eye(x.shape[1]) + along)
        signs = np.array([[1.0, -1.0], [-1.0, 1.0]])
        yield self._ends, gradient, np.einsum("ab,eij->eaibj", signs, block)


class _Coupled:
    """Biquadratic springs: q . M q of each element, q the change of the squared lengths of its links."""

    def __init__(self, values: Mapping[str, Any], kind: str) -> None:
        self._elements: Ints = np.asarray(values[f"corners{kind}" if kind else "elements"], dtype=np.int64)
        self._links: Ints = np.asarray(values[f"links{kind}"], dtype=np.int64)
        self._coupling: Floats = np.asarray(values[f"coupling{kind}"], dtype=float)
        self._rest = self._squares(np.asarray(values["nodes"], dtype=float))[1]

    def _squares(self, x: Floats) -> tuple[Floats, Floats]:
        ends = x[self._elements[:, self._links]]
        across = ends[:, :, 1] - ends[:, :, 0]
        return across, (across**2).sum(axis=2)

    def energy(self, x: Floats) -> float:
        change = self._squares(x)[1] - self._rest
        return float(np.einsum("es,est,et->", change, self._coupling, change))

    def parts(self, x: Floats, second: bool) -> Iterator[Parts]:
        across, squares = self._squares(x)
        pull = 2 * np.einsum("est,et->es", self._coupling, squares - self._rest)
        n, k = self._elements.shape
        every = np.arange(len(self._links))
        slope = np.zeros((n, len(self._links), k, x.shape[1]))  # of the squared lengths
        slope[:, every, self._links[:, 0]] = -2 * across
        slope[:, every, self._links[:, 1]] = 2 * across
        gradient = np.einsum("es,esai->eai", pull, slope)
        if not second:
            yield self._elements, gradient, np.zeros(0)
            return
        flat = slope.reshape(n, len(self._links), -1)
        stiff = flat.swapaxes(1, 2) @ (2 * self._coupling) @ flat
        turn = np.zeros((n, k, k))
        for link, (a, b) in enumerate(self._links):
            for row, column, sign in ((a, a, 2), (b, b, 2), (a, b, -2), (b, a, -2)):
                turn[:, row, column] += sign * pull[:, link]
        block = stiff.reshape(n, k, x.shape[1], k, x.shape[1])
        yield self._elements, gradient, block + np.einsum("eab,ij->eaibj", turn, np.eye(x.shape[1]))


class _Volumes:
    """A function of the volume of each element: of a volume term, or of Gaussian springs."""

    def __init__(self, nodes: Floats, elements: Ints, simplices: Ints, scale: float) -> None:
        self._elements, self._simplices, self._scale = elements, simplices, scale
        self._volume = self._volumes(nodes)
        self._function: Any = None

    @classmethod
    def gaussian(cls, values: Mapping[str, Any], kind: str) -> "_Volumes":
        """Return - mu ln J + lam/2 (ln J)^2 of elements of a kind, J the ratio of volumes."""
        found = cls._of(values, kind)
        lam, mu = (np.asarray(values[f"{name}{kind}"], dtype=float) for name in ("lam", "mu"))
        found._function = _LogVolume(lam, mu, str(values["section"]))
        return found

    @classmethod
    def of_term(cls, values: Mapping[str, Any]) -> "list[_Volumes]":
        """Return kappa/2 (V / V0 - 1)^2 of each element."""
        found = []
        for kind in _kinds(values, "simplices"):
            one = cls._of(values, kind)
            kappa = np.asarray(values["kappa"], dtype=float)
            one._function = _Quadratic(kappa[values[f"elements{kind}"]] if kind else kappa)
            found.append(one)
        return found

    @classmethod
    def _of(cls, values: Mapping[str, Any], kind: str) -> "_Volumes":
        nodes = np.asarray(values["nodes"], dtype=float)
        thickness = float(values["thickness"]) if nodes.shape[1] == 2 else 1.0
        scale = float(values[f"simplex_weight{kind}"]) * thickness / (2.0 if nodes.shape[1] == 2 else 6.0)
        elements = np.asarray(values[f"corners{kind}" if kind else "elements"], dtype=np.int64)
        return cls(nodes, elements, np.asarray(values[f"simplices{kind}"], dtype=np.int64), scale)

    def _edges(self, x: Floats) -> Floats:
        """Return the edges of the simplices from their first corner, shape (n, simplices, dim, dim)."""
        corners = x[self._elements[:, self._simplices]]
        return np.asarray(corners[:, :, 1:] - corners[:, :, :1])

    def _volumes(self, x: Floats) -> Floats:
        return np.asarray(self._scale * np.linalg.det(self._edges(x)).sum(axis=1))

    def energy(self, x: Floats) -> float:
        return float((self._volume * self._function(self._volumes(x) / self._volume)[0]).sum())

    def parts(self, x: Floats, second: bool) -> Iterator[Parts]:
        edges = self._edges(x)
        n, k = self._elements.shape
        dim = x.shape[1]
        _, slope, curvature = self._function(self._volumes(x) / self._volume)
        volume_slope = np.zeros((n, k, dim))
        cofactors = self._scale * _cofactors(edges)
        for place, corners in enumerate(self._simplices):
            volume_slope[:, corners[1:]] += cofactors[:, place]
            volume_slope[:, corners[0]] -= cofactors[:, place].sum(axis=1)
        gradient = slope[:, None, None] * volume_slope
        if not second:
            yield self._elements, gradient, np.zeros(0)
            return
        block = np.zeros((n, k, dim, k, dim))
        turns = (self._scale * slope)[:, None, None, None, None, None] * _second_of_determinants(edges)
        for place, corners in enumerate(self._simplices):
            whole = _with_first(turns[:, place])
            for a in range(dim + 1):
                for b in range(dim + 1):
                    block[:, corners[a], :, corners[b]] += whole[:, a, :, b]
        share = curvature / self._volume
        yield (
            self._elements,
            gradient,
            block + np.einsum("e,eai,ebj->eaibj", share, volume_slope, volume_slope),
        )


def _cofactors(edges: Floats) -> Floats:
    """Return the derivatives of the determinants of edges, shape (..., dim, dim), by the edges."""
    if edges.shape[-1] == 2:
        turned = edges[..., ::-1, ::-1] * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return np.asarray(turned)
    a, b, c = (edges[..., i, :] for i in range(3))
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)


def _second_of_determinants(edges: Floats) -> Floats:
    """Return the second derivatives of determinants by the edges, shape (..., dim, dim, dim, dim)."""
    dim = edges.shape[-1]
    found = np.zeros((*edges.shape[:-2], dim, dim, dim, dim))
    if dim == 2:
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
        found[..., 0, :, 1, :], found[..., 1, :, 0, :] = turn, turn.T
        return found
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        x, y, z = (edges[..., c, i] for i in range(3))
        zero = np.zeros_like(x)
        # the derivative of b x c by b is -[c]x, that of c x a by c is [b]x
        skew = np.stack([np.stack(row, axis=-1) for row in ((zero, z, -y), (-z, zero, x), (y, -x, zero))], axis=-2)
        found[..., a, :, b, :] = skew
        found[..., b, :, a, :] = skew.swapaxes(-1, -2)
    return found


def _with_first(turns: Floats) -> Floats:
    """Return second derivatives by the corners from those by the edges from the first corner, shape (n, k, d, k, d)."""
    n, dim = turns.shape[:2]
    found = np.zeros((n, dim + 1, dim, dim + 1, dim))
    found[:, 1:, :, 1:] = turns
    found[:, 0, :, 1:] = -turns.sum(axis=1)
    found[:, 1:, :, 0] = -turns.sum(axis=3)
    found[:, 0, :, 0] = turns.sum(axis=(1, 3))
    return found


class _Quadratic:
    """kappa/2 (J - 1)^2 and its derivatives by J."""

    def __init__(self, kappa: Floats) -> None:
        self._kappa = kappa

    def __call__(self, J: Floats) -> tuple[Floats, Floats, Floats]:
        return self._kappa / 2 * (J - 1) ** 2, self._kappa * (J - 1), self._kappa + 0 * J


class _LogVolume:
    """The part of the neo-Hookean law that depends on the volume, and its derivatives by J, or by ln J."""

    def __init__(self, lam: Floats, mu: Floats, section: str) -> None:
        self._lam, self._mu, self._section = lam, mu, section

    def by_log(self, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Return energy density, and derivatives by y = ln J, of the plane in plane stress [Pa]."""
        lam, mu = self._lam, self._mu
        if self._section != "plane stress":
            rest = mu if self._section == "plane strain" else 1.5 * mu
            return lam / 2 * y**2 - mu * y - rest, lam * y - mu, lam + 0 * y
        z = -2 * lam / (lam + 2 * mu) * y  # ln C33, without stress across the plane
        for _ in range(_ITERATIONS):
            step = (mu * (np.exp(z) - 1) + lam * (y + z / 2)) / (mu * np.exp(z) + lam / 2)
            z = z - step
            if not np.nanmax(np.abs(step), initial=0.0) > 1e-15:
                break
        C33, whole = np.exp(z), y + z / 2
        second = lam * 2 * mu * C33 / (2 * mu * C33 + lam)
        return mu / 2 * (C33 - 3) - mu * whole + lam / 2 * whole**2, lam * whole - mu, second

    def __call__(self, J: Floats) -> tuple[Floats, Floats, Floats]:
        energy, pressure, second = self.by_log(np.log(np.where(J > 0, J, np.nan)))
        return energy, pressure / J, (second - pressure) / J**2


class _Points:
    """The volume function at the points of elements of second order, the part of lam at the mean volume."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._elements: Ints = np.asarray(values["all_elements"], dtype=np.int64)
        self._gradients: Floats = np.asarray(values["gradients"], dtype=float)
        self._volume: Floats = np.asarray(values["point_volume"], dtype=float)
        lam, mu = (np.asarray(values[name], dtype=float) for name in ("lam", "mu"))
        self._lam, self._mu, section = lam, mu, str(values["section"])
        self._free = section == "plane stress"
        self._at_points = _LogVolume(lam[:, None] if self._free else 0 * lam[:, None], mu[:, None], section)

    def _state(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return J at the points, the gradients of the deformed body, and the mean of J."""
        F = np.einsum("eai,epaj->epij", x[self._elements], self._gradients)
        J = np.linalg.det(F)
        gradients = self._gradients @ np.linalg.inv(F)
        return np.where(J > 0, J, np.nan), gradients, (self._volume * J).sum(axis=1) / self._volume.sum(axis=1)

    def energy(self, x: Floats) -> float:
        J, _, mean = self._state(x)
        total = float((self._volume * self._at_points.by_log(np.log(J))[0]).sum())
        if self._free:
            return total
        return total + float((self._volume.sum(axis=1) * self._lam / 2 * np.log(mean) ** 2).sum())

    def parts(self, x: Floats, second: bool) -> Iterator[Parts]:
        J, g, mean = self._state(x)
        _, pressure, stiff = self._at_points.by_log(np.log(J))
        lam = np.zeros_like(mean) if self._free else self._lam
        of_mean = (lam * np.log(mean) / mean)[:, None] * J
        gradient = np.einsum("ep,epai->eai", self._volume * (pressure + of_mean), g)
        if not second:
            yield self._elements, gradient, np.zeros(0)
            return
        both = np.einsum("ep,epai,epbj->eaibj", self._volume * (stiff + of_mean), g, g)
        crossed = np.einsum("ep,epaj,epbi->eaibj", self._volume * (pressure + of_mean), g, g)
        slope = np.einsum("ep,epai->eai", self._volume * J, g)
        share = lam * (1 - np.log(mean)) / (mean**2 * self._volume.sum(axis=1))
        yield self._elements, gradient, both - crossed + np.einsum("e,eai,ebj->eaibj", share, slope, slope)
