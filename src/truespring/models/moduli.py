"""Moduli: what a spring model realises, known before anything is solved."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import MappingProxyType

import numpy as np
from scipy import optimize, sparse

from truespring.arrays import Floats
from truespring.errors import ModelError
from truespring.mesh import Mesh
from truespring.models.elasticity import affine_energies, hooke, lattice_classes, lattice_elasticity
from truespring.models.fem import Fem, element_matrices
from truespring.models.links import CORNERS, link_vectors
from truespring.models.relaxation import relaxed
from truespring.models.rules import require_body
from truespring.models.springs import Springs
from truespring.models.strain import uniform_strain, voigt_pairs
from truespring.models.volume import VolumeTerm
from truespring.problem import Fixed, Force, Problem

#: Depths, in elements, at which the bending factor is shown.
DEPTHS = (1, 2, 3, 4, 6, 8)

# Sections of more elements than this have no bending factor of their own.
_FINEST_SECTION = 150

# Unbalanced forces below this share of E h^(d-1) are rounding: a uniform strain is an equilibrium.
_BALANCED = 1e-8


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

    def refined(sign: float) -> float:
        def at(vector: Floats) -> float:
            return float(sign * value((vector / np.linalg.norm(vector))[None])[0])

        starts = directions[np.argsort(sign * found)[:40:10]]
        close = 1e-12 * float(np.abs(found).max())
        ends = [
            float(optimize.minimize(at, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": close}).fun)
            for start in starts
        ]
        return sign * min(float((sign * found).min()), *ends)

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


@lru_cache(maxsize=16)
def moduli(problem: Problem, springs: Springs) -> Moduli:
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
        elasticity = lattice_elasticity(alone, affine_energies(alone, shared), classes)
        elasticity[: mesh.dim, : mesh.dim] += springs.kappa(alone)[0]
    _require_resistance(elasticity)
    whole, patch_score, stable = elasticity, 0.0, True
    if not springs.coupled:
        whole, patch_score, stable = _relaxed(alone, springs, elasticity)
        elasticity = whole if classes is None else elasticity
    _require_resistance(elasticity)
    young, poisson = section.apparent_moduli(material)
    counts = _cells(mesh)
    sizes = {n: (n,) * (mesh.dim - 1) for n in DEPTHS} if counts else {}
    depth = counts[1] if counts and math.prod(counts[1:]) <= _FINEST_SECTION else None
    if counts and depth:
        sizes[depth] = counts[1:]
    per_spring = _spring_sums(mesh, stiffness)
    return Moduli(
        elasticity=elasticity,
        young_wanted=young,
        poisson_wanted=poisson,
        bending=_bending(alone, springs, sizes),
        fem_bending=_fem_bending(alone, tuple(sizes.items())),
        depth=depth,
        lattice=classes is not None,
        body=whole,
        patch_score=patch_score,
        n_springs=len(per_spring),
        n_negative=int((per_spring < 0).sum()),
        n_zero=int((per_spring == 0).sum()),
        stable=stable,
    )


def _require_resistance(elasticity: Floats) -> None:
    resistance = np.linalg.eigvalsh(elasticity)
    if not resistance[0] > 1e-12 * resistance[-1]:
        raise ModelError("these springs do not resist every strain: edges and diagonals must both carry")


def _sharing(mesh: Mesh) -> Floats:
    """How many elements share each link: of an unbounded regular mesh where that is known, else of this one."""
    if mesh.kind.sharing:
        return np.array(mesh.kind.sharing, dtype=float)
    pairs = np.sort(mesh.elements[:, np.array(mesh.kind.links)], axis=2)
    _, inverse, count = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(count[inverse.ravel()].reshape(pairs.shape[:2]), dtype=float)


def _spring_sums(mesh: Mesh, stiffness: Floats) -> Floats:
    """The stiffness of each pair of nodes [N/m]; sums that are rounding are zero."""
    pairs = np.sort(mesh.elements[:, np.array(mesh.kind.links)].reshape(-1, 2), axis=1)
    _, inverse = np.unique(pairs[:, 0] * mesh.n_nodes + pairs[:, 1], return_inverse=True)
    sums = np.bincount(inverse.ravel(), stiffness.ravel())
    return np.where(np.abs(sums) <= 1e-12 * np.abs(sums).max(), 0.0, sums)


def _relaxed(problem: Problem, springs: Springs, affine: Floats) -> tuple[Floats, float, bool]:
    """The elasticity of the body, its boundary strained uniformly [Pa], the patch score, and whether it is stable."""
    mesh = problem.mesh
    material, section = require_body(problem)
    outside = np.zeros(mesh.n_nodes, dtype=bool)
    outside[mesh.boundary] = True
    inner = np.flatnonzero(np.repeat(~outside, mesh.dim))
    if not inner.size:
        return affine, 0.0, True
    K = replace(springs, allow_negative=True).potential(problem).hessian(mesh.nodes).tocsr()
    strains = np.stack([uniform_strain(mesh.nodes, i, j).ravel() for i, j in voigt_pairs(mesh.dim)], axis=1)
    force = K @ strains
    size = (mesh.measures.sum() / len(mesh.elements)) ** ((mesh.dim - 1) / mesh.dim)
    unbalanced = force[inner] / (material.young * section.thickness * size)
    score = float(np.sqrt((unbalanced**2).mean(axis=0)).max() * np.sqrt(mesh.dim))
    if score <= _BALANCED:
        return affine, 0.0, True
    relaxing = relaxed(sparse.csr_array(K[inner][:, inner]), -force[inner], mesh.dim)
    if relaxing is None:
        return affine, score, False
    energy = strains.T @ force + force[inner].T @ relaxing
    return np.asarray((energy + energy.T) / 2 / (section.thickness * mesh.measures.sum())), score, True


# --- bending ----------------------------------------------------------------------------------------


def _cells(mesh: Mesh) -> tuple[int, ...] | None:
    """The numbers of cells along the axes where all elements are the same rectangle or brick along them."""
    if mesh.element not in ("quadrilateral", "hexahedron"):
        return None
    across = link_vectors(mesh)
    if np.abs(across - across[:1]).max() > 1e-6 * np.abs(across).max():
        return None
    at = mesh.nodes[mesh.elements[0]] - mesh.nodes[mesh.elements[0, 0]]
    sides = at[-2 if mesh.dim == 3 else 2]
    if (sides <= 0).any() or np.abs(at - CORNERS[: len(at), : mesh.dim] * sides).max() > 1e-6 * sides.max():
        return None
    counts = tuple(round(float(count)) for count in (mesh.upper - mesh.lower) / sides)
    return counts if math.prod(counts) == len(mesh.elements) else None


def _bending(
    problem: Problem, springs: Springs | None, sizes: dict[int, tuple[int, ...]]
) -> MappingProxyType[int, float]:
    """Bending factors by depth, of sections of so many elements through depth (and width); of FEM without springs."""
    if not sizes:
        return MappingProxyType({})
    one = _first_element(problem)
    return MappingProxyType({depth: _bending_factor(one, springs, sizes[depth]) for depth in sorted(sizes)})


@lru_cache(maxsize=8)
def _fem_bending(problem: Problem, sizes: tuple[tuple[int, tuple[int, ...]], ...]) -> MappingProxyType[int, float]:
    """The bending factors of the elements that are the default; the same for all springs on a body."""
    return _bending(problem, None, dict(sizes))


def _first_element(problem: Problem) -> Problem:
    """The mesh's first element as a problem of its own, held and loaded in some way."""
    mesh = problem.mesh
    last = mesh.kind.n_nodes - 1
    return replace(
        problem,
        mesh=Mesh(mesh.nodes[mesh.elements[0]], np.arange(last + 1)[None], mesh.element),
        supports=[Fixed(on=range(last))],
        loads=[Force(on=[last], total=[1.0] * mesh.dim)],
    )


def _bending_factor(problem: Problem, springs: Springs | None, counts: tuple[int, ...]) -> float:
    """EI of a strip of elements like the first under pure bending along x, over E I of the material in its section.

    A column of them is bent to unit curvature, u = (-x y, x^2 / 2), plus a displacement that repeats
    from column to column and makes the energy least; EI is twice that energy by length. For springs on
    squares with summed sharing it is e0 (1 - 1/n^2) + 6 a / n^2, e0 = E_0 / E.
    """
    material, section = require_body(problem)
    mesh = problem.mesh
    dim, corners = mesh.dim, CORNERS[: mesh.kind.n_nodes, : mesh.dim]
    sides = mesh.nodes[mesh.elements[0, -2 if dim == 3 else 2]] - mesh.nodes[mesh.elements[0, 0]]
    grid = np.array([count + 1 for count in counts])
    # Both ends of a cell along x are one place of the section.
    section_corners, place = np.unique(corners[:, 1:], axis=0, return_inverse=True)
    gather = np.kron(np.eye(len(section_corners))[place.ravel()], np.eye(dim))
    n_free = dim * int(np.prod(grid))
    stiffness, force, energy = np.zeros((n_free, n_free)), np.zeros(n_free), 0.0
    single = springs is not None and springs.sharing == "single"
    matrix = _element_matrix(problem, springs)
    for cell in np.ndindex(*counts):
        if single:
            matrix = _element_matrix(problem, springs, _shares_of_links(problem, cell, counts))
        numbers = np.ravel_multi_index(tuple((section_corners + np.array(cell)).T), tuple(grid))
        dofs = (dim * numbers[:, None] + np.arange(dim)).ravel()
        bent = np.zeros((len(corners), dim))
        bent[:, 0] = -corners[:, 0] * sides[0] * (corners[:, 1] + cell[0] - counts[0] / 2) * sides[1]
        bent[:, 1] = corners[:, 0] * sides[0] ** 2 / 2
        stiffness[np.ix_(dofs, dofs)] += gather.T @ matrix @ gather
        force[dofs] += gather.T @ matrix @ bent.ravel()
        energy += float(bent.ravel() @ matrix @ bent.ravel())
    energy -= float(force @ np.linalg.lstsq(stiffness, force, rcond=1e-10)[0])
    young, _ = section.apparent_moduli(material)
    width = section.thickness if dim == 2 else counts[1] * sides[2]
    return float(energy / sides[0] / (young * width * (counts[0] * sides[1]) ** 3 / 12))


def _element_matrix(problem: Problem, springs: Springs | None, share: Floats | None = None) -> Floats:
    """The linear matrix of the mesh's first element [N/m]; with `share`, of so much of each of its springs."""
    if springs is None:
        return np.asarray(Fem("linear").potential(problem).element_hessians(problem.mesh.nodes)[0])
    if springs.coupled:  # these are FEM
        return np.asarray(element_matrices(problem)[0])
    mesh = problem.mesh
    links, across = np.array(mesh.kind.links), link_vectors(mesh)[0]
    direction = across / np.linalg.norm(across, axis=1)[:, None]
    stencils = np.zeros((len(links), mesh.kind.n_nodes, mesh.dim))
    every = np.arange(len(links))
    stencils[every, links[:, 0]], stencils[every, links[:, 1]] = -direction, direction
    stiffness = springs.element_stiffness(problem)[0] * (1.0 if share is None else share)
    matrix = np.einsum("l,lai,lbj->aibj", stiffness, stencils, stencils).reshape((mesh.kind.n_nodes * mesh.dim,) * 2)
    if springs.volume:
        matrix += VolumeTerm(problem, springs.kappa(problem)).stiffening(mesh.nodes)[0]
    return np.asarray(matrix)


def _shares_of_links(problem: Problem, cell: tuple[int, ...], counts: tuple[int, ...]) -> Floats:
    """The part of each link that belongs to a cell of a strip, where one spring stands for all that share it.

    Two cells share what lies in the plane between them: always along x, inside the section across it.
    """
    dim = problem.mesh.dim
    links = np.array(problem.mesh.kind.links)
    ends = CORNERS[links][:, :, :dim]
    within = ends[:, 0] == ends[:, 1]
    places = ends[:, 0] + np.array([0, *cell])
    inside = np.ones_like(within)
    inside[:, 1:] = (places[:, 1:] > 0) & (places[:, 1:] < np.array(counts))
    return np.asarray(0.5 ** (within & inside).sum(axis=1))
