"""Energy and forces of springs and elements; needs only NumPy.

Arrays of nodes have shape (dim, n_nodes); those of elements end with the axis of the elements, k nodes each.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from truespring.exports.forces.laws import Array, Law, fibre_energy


def floats(own: Mapping[str, Any], *names: str) -> list[Array]:
    """Return the arrays of these names."""
    return [np.asarray(own[name], dtype=float) for name in names]


class Nodes:
    """Nodes of springs or elements, shape (k, n), to take positions and to add forces."""

    def __init__(self, numbers: Array, n_nodes: int) -> None:
        self.numbers, self.flat, self.n_nodes = numbers, numbers.ravel(), n_nodes

    def take(self, x: Array) -> Array:
        """Return the positions, shape (dim, k, n)."""
        return np.asarray(x[:, self.numbers])

    def add(self, values: Array, gradient: Array) -> None:
        """Add values of shape (dim, k, n) to those of the nodes."""
        for axis, own in enumerate(values):
            gradient[axis] += np.bincount(self.flat, own.ravel(), self.n_nodes)


@dataclass
class Springs:
    """Springs with stiffness k [N/m] and rest length L [m], shape (n_springs,)."""

    nodes: Nodes
    stiffness: Array
    rest: Array
    law: str
    dimension: int

    def add(self, x: Array, gradient: Array) -> float:
        """Add the gradient of the energy; return the energy."""
        a, b = self.nodes.take(x).swapaxes(0, 1)
        along = b - a
        square = (along**2).sum(axis=0)
        k, L, length, d = self.stiffness, self.rest, np.sqrt(square), self.dimension
        if self.law == "straight":
            tension, energy = k * (length - L), k / 2 * (length - L) ** 2
        else:  # neo-hookean
            s = length / L
            tension = k * L / (d + 2) * (s - s ** -(d + 1.0))
            energy = k * L**2 / (d + 2) * (s**2 / 2 + s**-d / d - 1 / 2 - 1 / d)
        pull = tension / length * along
        self.nodes.add(np.stack([-pull, pull], axis=1), gradient)
        return float(energy.sum())


class ZeroLengthSprings:
    """Springs of zero rest length with stiffness k [N/m]; each is listed at both of its nodes, in their order."""

    def __init__(self, nodes: Nodes, stiffness: Array) -> None:
        ends, others = nodes.numbers.ravel(), nodes.numbers[::-1].ravel()
        order = np.argsort(ends, kind="stable")
        self.ends, self.others, self.stiffness = ends[order], others[order], np.tile(stiffness, 2)[order]
        self.own, self.starts = np.unique(self.ends, return_index=True)

    def add(self, x: Array, gradient: Array) -> float:
        """Add the gradient of the energy; return the energy."""
        energy = 0.0
        for place, into in zip(x, gradient, strict=True):
            along = place[self.ends] - place[self.others]
            pull = self.stiffness * along
            into[self.own] += np.add.reduceat(pull, self.starts)
            energy += float(pull @ along) / 4
        return energy


class Measure:
    """The volume of an element, area times thickness in the plane, as a sum over simplices."""

    def __init__(self, simplices: Array, factor: float) -> None:
        self.simplices, self.factor = simplices, factor

    def at(self, x: Array) -> tuple[Array, Array]:
        """Return volume, shape (n,), and its derivatives, shape (dim, k, n), at positions of shape (dim, k, n)."""
        slope, volume = np.zeros_like(x), np.zeros(x.shape[2])
        for corners in self.simplices:
            edges = [x[:, corner] - x[:, corners[0]] for corner in corners[1:]]
            if len(edges) == 2:
                (u, v), (p, q) = edges
                faces = [np.stack([q, -p]), np.stack([-v, u])]
            else:
                faces = [_cross(edges[(i + 1) % 3], edges[(i + 2) % 3]) for i in range(3)]
            volume += self.factor * (edges[0] * faces[0]).sum(axis=0)
            for corner, face in zip(corners[1:], faces, strict=True):
                slope[:, corner] += self.factor * face
                slope[:, corners[0]] -= self.factor * face
        return volume, slope


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@dataclass
class VolumeTerm:
    """The energy kappa/2 V0 (V/V0 - 1)^2 of each element."""

    nodes: Nodes
    measure: Measure
    volume: Array
    kappa: Array

    def add(self, x: Array, gradient: Array) -> float:
        """Add the gradient of the energy; return the energy."""
        volume, slope = self.measure.at(self.nodes.take(x))
        growth = volume / self.volume - 1
        self.nodes.add(self.kappa * growth * slope, gradient)
        return float((self.kappa / 2 * self.volume * growth**2).sum())


@dataclass
class Coupled:
    """The energy q . M q of each element, with q the change of the squared lengths of its links."""

    nodes: Nodes
    links: Array
    coupling: Array  # shape (n or 1, links, links)
    at_rest: Array

    @staticmethod
    def of(nodes: Nodes, x: Array, own: Mapping[str, Any]) -> "Coupled":
        """Return the elements of one kind at rest at x."""
        links, coupling = np.asarray(own["links"]), np.asarray(own["coupling"], dtype=float)
        if (coupling == coupling[:1]).all():
            coupling = coupling[:1]
        corners = Nodes(nodes.numbers[: links.max() + 1], nodes.n_nodes)
        return Coupled(corners, links, coupling, _squares(corners.take(x), links)[0])

    def add(self, x: Array, gradient: Array) -> float:
        """Add the gradient of the energy; return the energy."""
        at = self.nodes.take(x)
        square, along = _squares(at, self.links)
        change = square - self.at_rest
        if len(self.coupling) == 1:
            pull = 2 * self.coupling[0] @ change
        else:
            pull = 2 * np.matmul(self.coupling, change.T[:, :, None])[:, :, 0].T
        self.nodes.add(_on_nodes(2 * pull * along, self.links, at.shape[1]), gradient)
        return float((change * pull).sum() / 2)


def _squares(at: Array, links: Array) -> tuple[Array, Array]:
    """Return squared lengths, shape (links, n), and vectors of links, shape (dim, links, n)."""
    along = at[:, links[:, 1]] - at[:, links[:, 0]]
    return (along**2).sum(axis=0), along


def _on_nodes(pull: Array, links: Array, k: int) -> Array:
    """Return the sum over links of forces on their second nodes, and minus those on their first, shape (dim, k, n)."""
    found = np.zeros((len(pull), k, pull.shape[2]))
    for number, (first, second) in enumerate(links.tolist()):
        found[:, first] -= pull[:, number]
        found[:, second] += pull[:, number]
    return found


class Forms(NamedTuple):
    """Quadratic forms of elements: links, and weights [m], shape (links, n), of the trace of C and of each family."""

    links: Array
    trace: "Array | None"
    fibres: tuple[Array, ...]


@dataclass
class Elements:
    """The energy V0 (W(I1, ln J) + fibres) of each element, without the part of springs of constant stiffness."""

    nodes: Nodes
    measure: Measure
    volume: Array
    law: Law
    forms: "Forms | None"
    constants: Mapping[str, Any]

    def add(self, x: Array, gradient: Array) -> float:
        """Add the gradient of the energy; return the energy."""
        at = self.nodes.take(x)
        volume, slope = self.measure.at(at)
        ratio = volume / self.volume
        if self.forms is None:
            density, pressure = self.law.of_volume(np.log(ratio))
            self.nodes.add(pressure / ratio * slope, gradient)
            return float((self.volume * density).sum())
        density, pressure, stiffness, along = self._with_forms(at, np.log(ratio), self.forms)
        force = pressure / ratio * slope + _on_nodes(stiffness * along, self.forms.links, at.shape[1])
        self.nodes.add(force, gradient)
        return float((self.volume * density).sum())

    def _with_forms(self, at: Array, y: Array, forms: Forms) -> tuple[Array, Array, Array, Array]:
        """Return energy density, pressure, stiffness of the links and their vectors."""
        square, along = _squares(at, forms.links)
        if forms.trace is None:
            density, pressure = self.law.of_volume(y)
            stiffness = np.zeros_like(square)
        else:
            density, by_trace, pressure = self.law.of_trace((forms.trace * square).sum(axis=0) / self.volume, y)
            stiffness = 2 * by_trace * forms.trace
        for weights in forms.fibres:
            I4 = (weights * square).sum(axis=0) / self.volume
            more, by_square = fibre_energy(I4, *floats(self.constants, "k1", "k2"))
            density, stiffness = density + more, stiffness + 2 * by_square * weights
        return density, pressure, stiffness, along


@dataclass
class Points:
    """Elements of second order: the energy of the volume and of fibres at points of integration."""

    nodes: Nodes
    gradients: Array  # shape (n, points, k, dim) [1/m]
    volumes: Array  # shape (n, points) [m^3]
    law: Law
    constants: Mapping[str, Any]

    def add(self, x: Array, gradient: Array) -> float:
        """Add the gradient of the energy; return the energy."""
        at = np.ascontiguousarray(self.nodes.take(x).transpose(2, 0, 1))[:, None]
        F = at @ self.gradients
        J, volumes = np.linalg.det(F), self.volumes
        inverse = np.linalg.inv(F)
        if self.law.section == "plane stress":
            density, pressure = (one.T for one in self.law.of_volume(np.log(J).T))
        else:
            mean = (J * volumes).sum(axis=1) / volumes.sum(axis=1)
            density, pressure = (one.T for one in self.law.of_mean(np.log(J).T, np.log(mean)))
            pressure = pressure + (self.law.lam * np.log(mean) / mean)[:, None] * J
        stress = pressure[:, :, None, None] * inverse.swapaxes(2, 3)
        for directions in self.constants.get("fibre_directions", ()):
            along = np.einsum("epij,ej->epi", F, directions)
            k1, k2 = (one[:, None] for one in floats(self.constants, "k1", "k2"))
            more, slope = fibre_energy((along**2).sum(axis=2), k1, k2)
            density = density + more
            stress = stress + 2 * slope[:, :, None, None] * along[:, :, :, None] * directions[:, None, None, :]
        forces = np.einsum("epij,epaj->iae", volumes[:, :, None, None] * stress, self.gradients, optimize=True)
        self.nodes.add(forces, gradient)
        return float((density * volumes).sum())
