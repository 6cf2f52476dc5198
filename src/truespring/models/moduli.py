"""Moduli: what a spring model realises, known before anything is solved."""

from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError
from truespring.models.fem import element_matrices
from truespring.models.rules import require_body
from truespring.models.springs import Springs
from truespring.problem import Problem

#: Depths, in elements, at which the bending factor is shown.
DEPTHS = (1, 2, 3, 4, 6, 8)


@dataclass(frozen=True, repr=False)
class Moduli:
    """Effective linear moduli of a plane spring lattice, beside those of the material in its section.

    Attributes:
        elasticity: of the unbounded lattice in Voigt form (xx, yy, xy) [Pa], shape (3, 3).
        young_wanted, poisson_wanted: what a test within the plane would find on the material [Pa], [-];
            in plane strain E / (1 - nu^2) and nu / (1 - nu).
        bending: EI of a strip n elements deep, bent along x, over that of the material; n to factor.
        fem_bending: the same of linear finite elements on this mesh: the error of the reference itself.
        depth: the number of elements through the depth (y) of this mesh, None where it is no lattice.
    """

    elasticity: Floats
    young_wanted: float
    poisson_wanted: float
    bending: MappingProxyType[int, float]
    fem_bending: MappingProxyType[int, float]
    depth: int | None

    def __repr__(self) -> str:
        return (
            f"Moduli(young={self.young():.6g} Pa, poisson={self.poisson():.4g}, young(45)={self.young(45):.6g} Pa, "
            f"poisson(45)={self.poisson(45):.4g}, zener={self.zener:.4g})"
        )

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
    resistance = np.linalg.eigvalsh(elasticity)
    if resistance[0] <= 1e-12 * resistance[-1]:
        raise ModelError("these springs do not resist every strain: edges and diagonals must both carry")
    young, poisson = section.plane_moduli(material)
    depth = _lattice_depth(problem)
    depths = sorted({*DEPTHS, depth}) if depth else []
    return Moduli(
        elasticity=elasticity,
        young_wanted=young,
        poisson_wanted=poisson,
        bending=MappingProxyType({n: _bending_factor(problem, _spring_rows(problem, springs, n)) for n in depths}),
        fem_bending=MappingProxyType({n: _bending_factor(problem, [element_matrices(problem)[0]] * n) for n in depths}),
        depth=depth,
    )


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
    if not (same and upright and across[0, 0, 0] > 0 and across[0, 1, 1] > 0):
        return None
    return round(float((mesh.upper - mesh.lower)[1] / across[0, 1, 1]))


def _spring_rows(problem: Problem, springs: Springs, depth: int) -> list[Floats]:
    """Return the element matrices [N/m] of a column of a strip, `depth` rows from bottom to top.

    With sharing "single" an edge between two elements belongs by half to each.
    """
    kind = problem.mesh.kind
    stiffness = springs.element_stiffness(problem)[0]
    across = _link_vectors(problem)[0]
    direction = across / np.linalg.norm(across, axis=1)[:, None]
    stencils = np.zeros((len(kind.links), len(kind.corners), problem.mesh.dim))
    for stencil, (first, second), n in zip(stencils, kind.links, direction, strict=True):
        stencil[first], stencil[second] = -n, n
    flat = stencils.reshape(len(kind.links), -1)
    rows = []
    for row in range(depth):
        share = np.ones(len(kind.links))
        if springs.sharing == "single":
            share = 1 / np.array(kind.sharing)
            share[0] = 1.0 if row == 0 else share[0]
            share[2] = 1.0 if row == depth - 1 else share[2]
        rows.append(np.einsum("l,li,lj->ij", share * stiffness, flat, flat))
    return rows


def _bending_factor(problem: Problem, rows: list[Floats]) -> float:
    """EI of a strip of elements under pure bending along x, over E t H^3 / 12 of the material in its section.

    `rows` are the matrices of a column of elements. It is bent to unit curvature, u = (-x y, x^2 / 2),
    plus a displacement that repeats from column to column and makes the energy least; EI is twice
    that energy by length. For springs on squares with summed sharing it is
    e0 (1 - 1/n^2) + 6 a / n^2, e0 = E_0 / E.
    """
    material, section = require_body(problem)
    mesh = problem.mesh
    width, height = (mesh.nodes[mesh.elements[0]] - mesh.nodes[mesh.elements[0, 0]])[2]
    depth = len(rows)
    levels = (np.arange(depth + 1) - depth / 2) * height
    n_free = 2 * (depth + 1)
    energy = np.zeros((n_free + 1, n_free + 1))
    for row, matrix in enumerate(rows):
        # Corners anticlockwise: each moves with its level, those on the right by the bending besides.
        moved = np.zeros((8, n_free + 1))
        for corner, (on_right, level) in enumerate(((0, row), (1, row), (1, row + 1), (0, row + 1))):
            moved[2 * corner : 2 * corner + 2, 2 * level : 2 * level + 2] = np.eye(2)
            moved[2 * corner : 2 * corner + 2, -1] = on_right * np.array([-width * levels[level], width**2 / 2])
        energy += moved.T @ matrix @ moved
    free = -np.linalg.pinv(energy[:-1, :-1], rcond=1e-10, hermitian=True) @ energy[:-1, -1]
    unit = np.append(free, 1.0)
    young, _ = section.plane_moduli(material)
    return float(unit @ energy @ unit / width / (young * section.thickness * (depth * height) ** 3 / 12))
