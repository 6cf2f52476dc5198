"""Moduli: what a spring model realises, known before anything is solved."""

from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError
from truespring.models.rules import require_body
from truespring.models.springs import Springs
from truespring.problem import Problem

#: Depths, in elements, at which the bending factor is shown.
DEPTHS = (1, 2, 3, 4, 6, 8)


@dataclass(frozen=True)
class Moduli:
    """Effective linear moduli of a plane spring lattice, beside those of the material in its section.

    Attributes:
        elasticity: of the unbounded lattice in Voigt form (xx, yy, xy) [Pa], shape (3, 3).
        young_wanted, poisson_wanted: what a test within the plane would find on the material [Pa], [-];
            in plane strain E / (1 - nu^2) and nu / (1 - nu).
        bending: EI of a strip n elements deep, bent along x, over that of the material; n to factor.
        depth: the number of elements through the depth (y) of this mesh, None where it is no lattice.
    """

    elasticity: Floats
    young_wanted: float
    poisson_wanted: float
    bending: MappingProxyType[int, float]
    depth: int | None

    @cached_property
    def _compliance(self) -> Floats:
        return np.asarray(np.linalg.inv(self.elasticity))

    def young(self, degrees: float = 0.0) -> float:
        """Return Young's modulus in a test along a direction, counted from x [Pa]."""
        return 1 / self._directional(degrees)[0]

    def poisson(self, degrees: float = 0.0) -> float:
        """Return Poisson's ratio in a test along a direction [-]."""
        along, across = self._directional(degrees)
        return -across / along

    def _directional(self, degrees: float) -> tuple[float, float]:
        """Strain along and across a direction for a unit stress along it [1/Pa]."""
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        along = np.array([c * c, s * s, 2 * c * s])
        across = np.array([s * s, c * c, -2 * c * s])
        response = self._compliance @ np.array([c * c, s * s, c * s])
        return float(response @ (along * [1, 1, 0.5])), float(response @ (across * [1, 1, 0.5]))

    @property
    def zener(self) -> float:
        """2 C66 / (C11 - C12), with the mean of C11 and C22 where they differ; 1 if isotropic [-]."""
        C = self.elasticity
        return float(2 * C[2, 2] / ((C[0, 0] + C[1, 1]) / 2 - C[0, 1]))


def moduli(problem: Problem, springs: Springs) -> Moduli:
    """Return what `springs` realise on the problem's mesh.

    The elasticity is C_ijkl = sum k L^2 n_i n_j n_k n_l over the springs of a cell, by its area and
    thickness: exact for a lattice, whose nodes are centres of symmetry. A spring that several
    elements share belongs to each by its part; with sharing "single" the part of one spring.
    Raises ModelError where the springs do not resist every strain.
    """
    material, section = require_body(problem)
    mesh = problem.mesh
    stiffness = springs.element_stiffness(problem)
    if springs.sharing == "single":
        stiffness = stiffness / np.array(mesh.kind.sharing)
    across = _link_vectors(problem)
    length = np.linalg.norm(across, axis=2)
    n = across / length[:, :, None]
    strain = np.stack([n[..., 0] ** 2, n[..., 1] ** 2, n[..., 0] * n[..., 1]], axis=-1)
    volume = mesh.measures.sum() * section.thickness
    elasticity = np.einsum("el,eli,elj->ij", stiffness * length**2, strain, strain) / volume
    if np.linalg.cond(elasticity) > 1e12:
        raise ModelError("these springs do not resist every strain: edges and diagonals must both carry")
    young, poisson = section.plane_moduli(material)
    depth = _lattice_depth(problem)
    factors = {n: _bending_factor(problem, springs, n) for n in (*DEPTHS, depth or 1)} if depth else {}
    return Moduli(elasticity, young, poisson, MappingProxyType(factors), depth)


def _link_vectors(problem: Problem) -> Floats:
    """From the first to the second node of each link [m], shape (n_elements, links, dim)."""
    links = np.array(problem.mesh.kind.links)
    at = problem.mesh.nodes[problem.mesh.elements]
    return at[:, links[:, 1]] - at[:, links[:, 0]]


def _lattice_depth(problem: Problem) -> int | None:
    """The number of elements through the depth where all elements are the same rectangle along the axes."""
    mesh = problem.mesh
    across = _link_vectors(problem)
    same = np.abs(across - across[:1]).max() <= 1e-6 * np.abs(across).max()
    upright = abs(across[0, 0, 1]) + abs(across[0, 1, 0]) <= 1e-6 * np.abs(across).max()
    if not (same and upright):
        return None
    return round(float((mesh.upper - mesh.lower)[1] / across[0, 1, 1]))


def _bending_factor(problem: Problem, springs: Springs, depth: int) -> float:
    """EI of a strip `depth` elements deep under pure bending along x, over E t H^3 / 12 of the section.

    One column of the strip is bent to unit curvature, u = (-x y, x^2 / 2), plus a displacement that
    repeats from column to column and makes the energy least; EI is twice that energy by length.
    On squares with summed sharing it is e0 (1 - 1/n^2) + 6 a / n^2 with e0 = E_0 / E.
    """
    material, section = require_body(problem)
    mesh = problem.mesh
    stiffness = springs.element_stiffness(problem)[0]
    corner = mesh.nodes[mesh.elements[0]] - mesh.nodes[mesh.elements[0, 0]]
    width, height = corner[2]
    levels = (np.arange(depth + 1) - depth / 2) * height
    springs_of_column: dict[tuple[int, int, int], list[float]] = {}
    for row in range(depth):
        for (first, second), k in zip(mesh.kind.links, stiffness, strict=True):
            ends = sorted(
                (round(corner[node, 0] / width), row + round(corner[node, 1] / height)) for node in (first, second)
            )
            (column_a, a), (column_b, b) = ends
            # Both uprights of a column are the same spring of the repeating strip.
            springs_of_column.setdefault((a, b, column_b - column_a), []).append(float(k))
    rows, weights = [], []
    for (a, b, step), parts in springs_of_column.items():
        k = sum(parts) if springs.sharing == "summed" else float(np.mean(parts))
        across = np.array([step * width, levels[b] - levels[a]])
        n = across / np.linalg.norm(across)
        bent = np.array([-step * width * levels[b], step * width**2 / 2])
        elongation = np.zeros(2 * (depth + 1) + 1)
        elongation[2 * b : 2 * b + 2] += n
        elongation[2 * a : 2 * a + 2] -= n
        elongation[-1] = n @ bent
        rows.append(elongation)
        weights.append(k)
    system, weight = np.array(rows), np.array(weights)
    matrix = system.T @ (weight[:, None] * system)
    free = -np.linalg.pinv(matrix[:-1, :-1], rcond=1e-10, hermitian=True) @ matrix[:-1, -1]
    unit = np.append(free, 1.0)
    energy_twice = float(unit @ matrix @ unit)
    young, _ = section.plane_moduli(material)
    return float(energy_twice / width / (young * section.thickness * (depth * height) ** 3 / 12))
