"""Effective moduli of springs, computed before the study is solved."""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError
from truespring.mesh import MIXED, Mesh
from truespring.mesh.rows import distinct_rows
from truespring.models.bending import bending_factors, cell_counts, fem_bending_factors
from truespring.models.by_rule import SpringCounts, SpringsByRule
from truespring.models.elasticity import hooke, lattice_classes, lattice_elasticity
from truespring.models.links import in_a_row, n_links
from truespring.models.relaxation import relaxed_elasticity
from truespring.models.rules import require_body
from truespring.models.strain import voigt_pairs
from truespring.problem import Problem
from truespring.remembering import remembered

#: Depths at which the bending factor is reported, in elements.
DEPTHS = (1, 2, 3, 4, 6, 8)

# Largest section for which the bending factor of the mesh is computed, in elements.
_FINEST_SECTION = 150

# Stiffness below this share of the largest is rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True, repr=False)
class Moduli:
    """Effective linear moduli of a body of springs, and the moduli of its material.

    Attributes:
        elasticity: elasticity matrix of the infinite lattice or, on an irregular mesh, of the body under a uniform
            strain of its boundary [Pa], in Voigt's order (xx, yy, xy or xx, yy, zz, yz, xz, xy), shape (3, 3) or
            (6, 6).
        material_young, material_poisson: apparent moduli of the material [Pa], [-]; in plane strain E / (1 - nu^2) and
            nu / (1 - nu).
        bending: bending factor by depth: EI of a strip n elements deep (n by n in 3D), bent along x, over that of the
            material [-].
        fem_bending: bending factors of finite elements on the same mesh: the discretisation error of the reference.
        depth: number of elements through the depth (y) of this mesh. None if it is not a lattice of rectangles or
            bricks along the axes, or so fine that its bending factor is that of the bulk. In 3D, `bending[depth]` is
            for the width (z) of this mesh.
        lattice: whether the mesh is a lattice, so that the moduli are exact.
        body: elasticity matrix of the body under a uniform strain of its boundary [Pa], as `elasticity`. It differs
            from that of the lattice if the outer elements are cut, as those of body-centred-cubic tetrahedra are.
        patch_score: root-mean-square unbalanced force at inner nodes under unit uniform strains, over E h^(d-1) with
            element size h [-]; 0 if a uniform strain is an equilibrium.
        n_springs, n_negative, n_zero: number of springs, and of springs with negative and with zero stiffness.
        stable: whether the undeformed body is stable, as far as known, if springs have negative stiffness.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> found = ts.moduli(problem, ts.Springs("lloyd"))
        >>> round(found.poisson(), 3), round(found.anisotropy, 3)
        (0.412, 1.4)
    """

    elasticity: Floats
    material_young: float
    material_poisson: float
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

    def _repr_html_(self) -> str:
        """Return the moduli as HTML for a notebook: a table and a picture."""
        from truespring.showing.values import html_of

        return html_of(self)

    @property
    def dim(self) -> int:
        """Dimension of the body, 2 or 3."""
        return 2 if len(self.elasticity) == 3 else 3

    @property
    def young_wanted(self) -> float:
        """Deprecated: `material_young`."""
        _warn_renamed("young_wanted", "material_young")
        return self.material_young

    @property
    def poisson_wanted(self) -> float:
        """Deprecated: `material_poisson`."""
        _warn_renamed("poisson_wanted", "material_poisson")
        return self.material_poisson

    @cached_property
    def _compliance(self) -> Floats:
        return np.asarray(np.linalg.inv(self.elasticity))

    def young(self, along: float | Sequence[float] = 0.0) -> float:
        """Return Young's modulus along a direction [Pa], given as a vector or as an angle from x to y in degrees."""
        return 1 / self._directional(along)[0]

    def poisson(self, along: float | Sequence[float] = 0.0) -> float:
        """Return Poisson's ratio for tension along a direction [-], in 3D the mean over the transverse directions."""
        axial, sideways = self._directional(along)
        return -sideways / axial

    def _directional(self, along: float | Sequence[float]) -> tuple[float, float]:
        """Return the axial and the mean transverse strain for a unit stress along a direction [1/Pa]."""
        n = self._unit(along)
        strain = self._compliance @ _voigt_stress(n)
        axial = float(_voigt_stress(n) @ strain)
        return axial, (float(strain[: self.dim].sum()) - axial) / (self.dim - 1)

    def _unit(self, along: float | Sequence[float]) -> Floats:
        """Return the unit vector of a direction, shape (dim,)."""
        if np.ndim(along) == 0:
            along = float(along)  # type: ignore[arg-type]
            turned = np.array([np.cos(np.radians(along)), np.sin(np.radians(along)), 0.0])[: self.dim]
            return np.asarray(turned)
        vector = np.asarray(along, dtype=float)
        if vector.shape != (self.dim,) or not np.linalg.norm(vector) > 0:
            raise ModelError(f"along = {along!r}: must be an angle in degrees or a vector of {self.dim} components")
        return np.asarray(vector / np.linalg.norm(vector))

    def young_along(self, directions: Floats) -> Floats:
        """Return Young's modulus along unit vectors of shape (n, dim) [Pa], shape (n,)."""
        stress = np.stack([directions[:, i] * directions[:, j] for i, j in voigt_pairs(self.dim)], axis=1)
        return np.asarray(1 / np.einsum("ni,ij,nj->n", stress, self._compliance, stress))

    def poisson_along(self, directions: Floats) -> Floats:
        """Return Poisson's ratio along unit vectors of shape (n, dim) [-], in 3D the transverse mean, shape (n,)."""
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
        """Zener ratio 2 C66 / (C11 - C12) of the mean constants over the axes [-]; 1 if isotropic."""
        C, dim = self.elasticity, self.dim
        normal = np.diag(C)[:dim].mean()
        mixed = C[:dim, :dim][~np.eye(dim, dtype=bool)].mean()
        return float(2 * np.diag(C)[dim:].mean() / (normal - mixed))

    @property
    def anisotropy(self) -> float:
        """Zener ratio in 2D, largest over smallest Young's modulus in 3D [-]; 1 if isotropic."""
        if self.dim == 2:
            return self.zener
        lowest, highest = self.young_range
        return highest / lowest

    @cached_property
    def poisson_range(self) -> tuple[float, float]:
        """Smallest and largest Poisson's ratio over all directions of tension [-]."""
        return _extremes(self.poisson_along, self.dim)

    @property
    def deviation(self) -> float:
        """Relative difference between the elasticity matrices of springs and material, in the Frobenius norm [-].

        Uses Mandel's notation, so that the result does not depend on the axes.
        """
        dim = self.dim
        young, poisson = self.material_young, self.material_poisson
        mu = young / (2 * (1 + poisson))
        lam = 2 * mu * poisson / (1 - poisson) if dim == 2 else 2 * mu * poisson / (1 - 2 * poisson)
        exact = hooke(lam, mu, dim)
        weight = np.sqrt([1.0] * dim + [2.0] * (len(exact) - dim))
        mandel = weight[:, None] * weight
        return float(np.linalg.norm(mandel * (self.elasticity - exact)) / np.linalg.norm(mandel * exact))


def _extremes(value: Callable[[Floats], Floats], dim: int) -> tuple[float, float]:
    """Return the smallest and largest value over all directions: the best few of a fixed set, refined."""
    directions = _directions(dim)
    found = value(directions)

    around = np.stack(np.meshgrid(*[(-1.0, 0.0, 1.0)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)

    def refined(sign: float) -> float:
        best = directions[np.argsort(sign * found)[:40:10]]
        step = 0.1  # larger than the distance of neighbouring directions
        while step > 1e-8:  # values are flat at an extremum: found to rounding
            near = best[:, None] + step * around
            near /= np.linalg.norm(near, axis=2, keepdims=True)
            values = sign * value(near.reshape(-1, dim)).reshape(near.shape[:2])
            best = near[np.arange(len(best)), values.argmin(axis=1)]
            step *= 0.6
        return sign * min(float((sign * found).min()), float(values.min()))

    return refined(1.0), refined(-1.0)


def _voigt_stress(n: Floats) -> Floats:
    """Return the stress n n^T in Voigt's order, shape (3,) or (6,)."""
    return np.array([n[i] * n[j] for i, j in voigt_pairs(len(n))])


def _directions(dim: int) -> Floats:
    """Return evenly distributed unit vectors, with axes and diagonals, shape (n, dim)."""
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
    """Return the effective moduli of springs on the mesh of a problem, all of it of the material of the problem.

    Fibres are left out: the moduli are those of the material between them.

    On a lattice whose nodes are centres of symmetry, a uniform strain is an equilibrium, and
    C_ijkl = sum k L^2 n_i n_j n_k n_l over the springs of a cell, divided by its volume, is exact (Born and Huang,
    Dynamical Theory of Crystal Lattices, 1954). On an irregular mesh, a uniform strain is applied to the boundary and
    the inner nodes relax. The stiffness of a spring that several elements share is divided among them.
    Raises ModelError if the springs do not resist every strain.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> found = ts.moduli(problem, ts.Springs("lloyd"))
        >>> round(found.young() / 10e3, 3), round(found.young(45) / 10e3, 3)
        (0.882, 1.105)
    """
    material, section = require_body(problem)
    plain = problem.without_fibres
    alone = replace(plain, regions=()) if plain.regions else plain
    mesh = alone.mesh
    classes = lattice_classes(mesh)
    if springs.coupled:
        lame = section.lame_within(material)
        elasticity = hooke(lame.lam, lame.mu, mesh.dim)
    else:
        stiffness = springs.element_stiffness(alone)
        shared = stiffness / _sharing(mesh) if springs.sharing == "single" else stiffness
        elasticity = lattice_elasticity(alone, shared, classes)
        elasticity[: mesh.dim, : mesh.dim] += springs.kappa(alone)[0]
    _require_resistance(elasticity)
    counts = springs.counts(alone)
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
        material_young=young,
        material_poisson=poisson,
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


def _warn_renamed(former: str, name: str) -> None:
    """Issue a DeprecationWarning for an attribute that was renamed."""
    warnings.warn(f"Moduli.{former} is deprecated, use Moduli.{name}", DeprecationWarning, stacklevel=3)


def _require_resistance(elasticity: Floats) -> None:
    """Raise ModelError if an elasticity matrix is not positive definite."""
    resistance = np.linalg.eigvalsh(elasticity)
    if not resistance[0] > 1e-12 * resistance[-1]:
        raise ModelError("these springs do not resist every strain: give edges and diagonals a stiffness")


def _sharing(mesh: Mesh) -> Floats:
    """Return how many elements share each link, in the infinite lattice if the kind of element has one, else here."""
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
    """Return a key of the two nodes of each element's links, link by link, kind by kind, shape (n,)."""
    keys = [part.pair_keys(part.kind.links).ravel() for _, part in mesh.blocks]
    return keys[0] if len(keys) == 1 else np.concatenate(keys)


def spring_counts(mesh: Mesh, stiffness: Floats) -> SpringCounts:
    """Count the springs of a mesh; `stiffness` of each element's links [N/m], shape (n_elements, links).

    The stiffness of a spring is the sum over the elements that share it. Rounding counts as zero.
    """
    smallest = float(in_a_row(mesh, stiffness).min())
    if smallest > 1e3 * _ROUNDING * stiffness.max():  # a spring has fewer than 1000 elements
        return SpringCounts(_n_links(mesh), 0, 0)
    found = distinct_rows([_link_keys(mesh)])
    by_kind = [stiffness[numbers, : len(part.kind.links)].T.ravel() for numbers, part in mesh.blocks]
    sums = np.add.reduceat(np.concatenate(by_kind)[found.order], found.starts)
    rounding = _ROUNDING * np.abs(sums).max()
    return SpringCounts(len(sums), int((sums < -rounding).sum()), int((np.abs(sums) <= rounding).sum()))


@remembered
def _n_links(mesh: Mesh) -> int:
    """Return the number of pairs of nodes that are joined by links."""
    keys = _link_keys(mesh)
    keys.sort(kind="stable")
    return 1 + int(np.count_nonzero(keys[1:] != keys[:-1]))
