"""Moduli: what a spring model realises, known before anything is solved."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError
from truespring.mesh import MIXED, Mesh
from truespring.mesh.rows import distinct_rows
from truespring.models.bending import bending_factors, cell_counts, fem_bending_factors
from truespring.models.by_rule import SpringsByRule
from truespring.models.elasticity import hooke, lattice_classes, lattice_elasticity
from truespring.models.links import in_a_row, n_links
from truespring.models.relaxation import relaxed_elasticity
from truespring.models.rules import require_body
from truespring.models.strain import voigt_pairs
from truespring.problem import Problem
from truespring.remembering import remembered

#: Depths, in elements, at which the bending factor is shown.
DEPTHS = (1, 2, 3, 4, 6, 8)

# Sections of more elements than this have no bending factor of their own.
_FINEST_SECTION = 150

# Sums of stiffness below this share of the largest are rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True, repr=False)
class Moduli:
    """Effective linear moduli of a body of springs, beside those of the material in its section.

    Attributes:
        elasticity: of the unbounded lattice, or of this irregular body with its boundary strained
            uniformly, in Voigt's order (xx, yy, xy or xx, yy, zz, yz, xz, xy) [Pa], shape (3, 3) or (6, 6).
        young_wanted, poisson_wanted: what a test within the mesh's directions would find on the material [Pa],
            [-]; in plane strain E / (1 - nu^2) and nu / (1 - nu).
        bending: EI of a strip n elements deep (in 3D n by n), bent along x, over that of the material; n to factor.
        fem_bending: the same of linear finite elements on this mesh: the error of the reference itself.
        depth: the number of elements through the depth (y) of this mesh, None where it is no lattice of
            rectangles or bricks along the axes, or one so fine that its bending factor is that of the bulk; in
            3D `bending[depth]` has this mesh's width (z).
        lattice: whether the mesh is a lattice, whose moduli are exact.
        body: the elasticity of this very body, its boundary strained uniformly: of a lattice that is cut off at the
            outside, as body-centred-cubic tetrahedra are, other than the lattice's [Pa], as `elasticity`.
        patch_score: the patch test under unit uniform strains: root-mean-square unbalanced force at inner nodes
            over E h^(d-1) [-], h the size of an element; 0 where uniform strain is an equilibrium.
        n_springs, n_negative, n_zero: springs of the mesh, and those of negative and of no stiffness.
        stable: whether springs of negative stiffness, if any, leave the body at rest stable as far as was seen.
    """

    elasticity: Floats
    young_wanted: float
    poisson_wanted: float
    bending: MappingProxyType[int, float]
    fem_bending: MappingProxyType[int, float]
    depth: int | None
    lattice: bool
    body: Floats
    patch_score: float
    n_springs: int
    n_negative: int
    n_zero: int
    stable: bool

    def __repr__(self) -> str:
        lowest, highest = self.young_range
        return (
            f"Moduli(young={self.young():.6g} Pa, poisson={self.poisson():.4g}, "
            f"young in all directions={lowest:.6g} to {highest:.6g} Pa, anisotropy={self.anisotropy:.4g})"
        )

    @property
    def dim(self) -> int:
        """The number of directions."""
        return 2 if len(self.elasticity) == 3 else 3

    @cached_property
    def _compliance(self) -> Floats:
        return np.asarray(np.linalg.inv(self.elasticity))

    def young(self, along: float | Sequence[float] = 0.0) -> float:
        """Return Young's modulus in a test along a direction [Pa]: a vector, or an angle from x to y in degrees."""
        return 1 / self._directional(along)[0]

    def poisson(self, along: float | Sequence[float] = 0.0) -> float:
        """Return Poisson's ratio in a test along a direction [-]; in 3D the mean of all directions across it."""
        axial, sideways = self._directional(along)
        return -sideways / axial

    def _directional(self, along: float | Sequence[float]) -> tuple[float, float]:
        """Strain along and, as the mean, across a direction for a unit stress along it [1/Pa]."""
        n = self._unit(along)
        strain = self._compliance @ _voigt_stress(n)
        axial = float(_voigt_stress(n) @ strain)
        return axial, (float(strain[: self.dim].sum()) - axial) / (self.dim - 1)

    def _unit(self, along: float | Sequence[float]) -> Floats:
        if np.ndim(along) == 0:
            along = float(along)  # type: ignore[arg-type]
            turned = np.array([np.cos(np.radians(along)), np.sin(np.radians(along)), 0.0])[: self.dim]
            return np.asarray(turned)
        vector = np.asarray(along, dtype=float)
        if vector.shape != (self.dim,) or not np.linalg.norm(vector) > 0:
            raise ModelError(f"along = {along!r}: an angle in degrees or a vector of {self.dim} components is wanted")
        return np.asarray(vector / np.linalg.norm(vector))

    def young_along(self, directions: Floats) -> Floats:
        """Return Young's modulus along unit vectors [Pa], shape (n, dim) to (n,)."""
        stress = np.stack([directions[:, i] * directions[:, j] for i, j in voigt_pairs(self.dim)], axis=1)
        return np.asarray(1 / np.einsum("ni,ij,nj->n", stress, self._compliance, stress))

    def poisson_along(self, directions: Floats) -> Floats:
        """Return Poisson's ratio along unit vectors, in 3D the mean across [-], shape (n, dim) to (n,)."""
        stress = np.stack([directions[:, i] * directions[:, j] for i, j in voigt_pairs(self.dim)], axis=1)
        strain = stress @ self._compliance
        axial = (strain * stress).sum(axis=1)
        return np.asarray(-(strain[:, : self.dim].sum(axis=1) - axial) / (self.dim - 1) / axial)

    @cached_property
    def young_range(self) -> tuple[float, float]:
        """Smallest and largest Young's modulus over all directions [Pa]."""
        return _extremes(self.young_along, self.dim)

    @property
    def zener(self) -> float:
        """2 C66 / (C11 - C12), normal and mixed constants as means where they differ; 1 if isotropic [-]."""
        C, dim = self.elasticity, self.dim
        normal = np.diag(C)[:dim].mean()
        mixed = C[:dim, :dim][~np.eye(dim, dtype=bool)].mean()
        return float(2 * np.diag(C)[dim:].mean() / (normal - mixed))

    @property
    def anisotropy(self) -> float:
        """In the plane Zener's ratio, in space the largest over the smallest Young's modulus; 1 if isotropic [-]."""
        if self.dim == 2:
            return self.zener
        lowest, highest = self.young_range
        return highest / lowest

    @cached_property
    def poisson_range(self) -> tuple[float, float]:
        """Smallest and largest Poisson's ratio over the directions of the test [-]."""
        return _extremes(self.poisson_along, self.dim)

    @property
    def deviation(self) -> float:
        """How far the elasticity is from the material's: the norm of their difference over the material's [-].

        In Mandel's form, so that the directions of the axes do not matter.
        """
        dim = self.dim
        young, poisson = self.young_wanted, self.poisson_wanted
        mu = young / (2 * (1 + poisson))
        lam = 2 * mu * poisson / (1 - poisson) if dim == 2 else 2 * mu * poisson / (1 - 2 * poisson)
        wanted = hooke(lam, mu, dim)
        weight = np.sqrt([1.0] * dim + [2.0] * (len(wanted) - dim))
        mandel = weight[:, None] * weight
        return float(np.linalg.norm(mandel * (self.elasticity - wanted)) / np.linalg.norm(mandel * wanted))


def _extremes(value: Callable[[Floats], Floats], dim: int) -> tuple[float, float]:
    """Smallest and largest value over all directions: of many tried the best few, refined."""
    directions = _directions(dim)
    found = value(directions)

    around = np.stack(np.meshgrid(*[(-1.0, 0.0, 1.0)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)

    def refined(sign: float) -> float:
        best = directions[np.argsort(sign * found)[:40:10]]
        step = 0.1  # wider than directions are apart
        while step > 1e-8:  # there a value is flat: it is found to rounding
            near = best[:, None] + step * around
            near /= np.linalg.norm(near, axis=2, keepdims=True)
            values = sign * value(near.reshape(-1, dim)).reshape(near.shape[:2])
            best = near[np.arange(len(best)), values.argmin(axis=1)]
            step *= 0.6
        return sign * min(float((sign * found).min()), float(values.min()))

    return refined(1.0), refined(-1.0)


def _voigt_stress(n: Floats) -> Floats:
    """The stress n n^T in Voigt's order."""
    return np.array([n[i] * n[j] for i, j in voigt_pairs(len(n))])


def _directions(dim: int) -> Floats:
    """Unit vectors that cover all directions evenly, the axes and diagonals among them, shape (n, dim)."""
    if dim == 2:
        angle = np.radians(np.arange(0.0, 180.0, 0.5))
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    count = 1000  # a Fibonacci lattice on half of the sphere
    z = (np.arange(count) + 0.5) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    ring = np.sqrt(1 - z**2)
    lattice = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
    signs = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) > (0, 0, 0)])
    return np.concatenate([signs / np.linalg.norm(signs, axis=1, keepdims=True), lattice])


@remembered
def moduli(problem: Problem, springs: SpringsByRule) -> Moduli:
    """Return what `springs` realise on the problem's mesh, were it all of the problem's own material.

    On a lattice, whose nodes are centres of symmetry, a uniform strain is an equilibrium and
    C_ijkl = sum k L^2 n_i n_j n_k n_l over the springs of a cell, by its volume, is exact. On an
    irregular mesh the nodes inside relax while the boundary is strained uniformly. A spring that
    several elements share belongs to each by its part; with sharing "single" the part of one spring.
    Raises ModelError where the springs do not resist every strain.
    """
    material, section = require_body(problem)
    alone = replace(problem, regions=()) if problem.regions else problem
    mesh = alone.mesh
    classes = lattice_classes(mesh)
    stiffness = springs.element_stiffness(alone)
    if springs.coupled:
        lame = section.lame_within(material)
        elasticity = hooke(lame.lam, lame.mu, mesh.dim)
    else:
        shared = stiffness / _sharing(mesh) if springs.sharing == "single" else stiffness
        elasticity = lattice_elasticity(alone, shared, classes)
        elasticity[: mesh.dim, : mesh.dim] += springs.kappa(alone)[0]
    _require_resistance(elasticity)
    counts = spring_counts(mesh, stiffness)
    whole, patch_score, stable = elasticity, 0.0, True
    if not springs.coupled:
        found, patch_score = relaxed_elasticity(alone, springs, shared, counts.n_negative > 0)
        stable = patch_score == 0 or found is not None
        whole = elasticity if found is None else found
        elasticity = whole if classes is None else elasticity
    _require_resistance(elasticity)
    young, poisson = section.apparent_moduli(material)
    cells = cell_counts(mesh)
    sizes = {n: (n,) * (mesh.dim - 1) for n in DEPTHS} if cells else {}
    depth = cells[1] if cells and math.prod(cells[1:]) <= _FINEST_SECTION else None
    if cells and depth:
        sizes[depth] = cells[1:]
    return Moduli(
        elasticity=elasticity,
        young_wanted=young,
        poisson_wanted=poisson,
        bending=bending_factors(alone, springs, sizes),
        fem_bending=fem_bending_factors(alone, tuple(sizes.items())),
        depth=depth,
        lattice=classes is not None,
        body=whole,
        patch_score=patch_score,
        n_springs=counts.n_springs,
        n_negative=counts.n_negative,
        n_zero=counts.n_zero,
        stable=stable,
    )


def _require_resistance(elasticity: Floats) -> None:
    resistance = np.linalg.eigvalsh(elasticity)
    if not resistance[0] > 1e-12 * resistance[-1]:
        raise ModelError("these springs do not resist every strain: edges and diagonals must both carry")


def _sharing(mesh: Mesh) -> Floats:
    """How many elements share each link: of an unbounded regular mesh where that is known, else of this one."""
    if mesh.element != MIXED and mesh.kind.sharing:
        return np.array(mesh.kind.sharing, dtype=float)
    found = distinct_rows([_link_keys(mesh)])
    count = found.count[found.of].astype(float)
    shares, first = np.ones((len(mesh.elements), n_links(mesh))), 0
    for numbers, part in mesh.blocks:
        k = len(part.kind.links)
        last = first + k * len(numbers)
        shares[numbers, :k] = count[first:last].reshape(k, -1).T
        first = last
    return shares


def _link_keys(mesh: Mesh) -> Ints:
    """A number for each link of each element, the same for the same two nodes: link after link, kind after kind."""
    keys = [part.pair_keys(part.kind.links).ravel() for _, part in mesh.blocks]
    return keys[0] if len(keys) == 1 else np.concatenate(keys)


class SpringCounts(NamedTuple):
    """The springs of a mesh, and those of negative and of no stiffness."""

    n_springs: int
    n_negative: int
    n_zero: int


def spring_counts(mesh: Mesh, stiffness: Floats) -> SpringCounts:
    """Count springs, each the sum of what its elements give [N/m], shape (n_elements, links); rounding is zero."""
    smallest = float(in_a_row(mesh, stiffness).min())
    if smallest > 1e3 * _ROUNDING * stiffness.max():  # no thousand elements share a spring
        return SpringCounts(_n_links(mesh), 0, 0)
    found = distinct_rows([_link_keys(mesh)])
    given = [stiffness[numbers, : len(part.kind.links)].T.ravel() for numbers, part in mesh.blocks]
    sums = np.add.reduceat(np.concatenate(given)[found.order], found.starts)
    rounding = _ROUNDING * np.abs(sums).max()
    return SpringCounts(len(sums), int((sums < -rounding).sum()), int((np.abs(sums) <= rounding).sum()))


@remembered
def _n_links(mesh: Mesh) -> int:
    """The number of pairs of nodes that links join."""
    keys = _link_keys(mesh)
    keys.sort(kind="stable")
    return 1 + int(np.count_nonzero(keys[1:] != keys[:-1]))
