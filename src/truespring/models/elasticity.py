"""Elasticity matrix of the undeformed springs of a mesh, and the classes of elements of a lattice."""

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.memory import slices
from truespring.mesh import Mesh
from truespring.mesh.forms import rounded
from truespring.mesh.rows import distinct_rows
from truespring.models.links import link_vectors
from truespring.models.strain import voigt_pairs
from truespring.problem import Problem
from truespring.remembering import remembered

# Largest number of classes of elements, up to translation, in a lattice: the body-centred-cubic one has 12, divisions
# about several diagonals have more.
_MOST_CLASSES = 48


@remembered
def lattice_classes(mesh: Mesh) -> Ints | None:
    """Return the class of each element, shape (n_elements,); None if the mesh is not a lattice.

    Two elements are of one class if a translation maps one to the other, in any order of their nodes. A lattice has
    few classes, each distributed over the whole body. Elements at the boundary of other classes than the inner ones
    have -1.
    """
    classes = _classes(mesh)
    # Only lattices of tetrahedra have other elements at a plane boundary than inside.
    inner = ~_at_boundary(mesh) if mesh.element == "tetrahedron" else np.ones(len(classes), dtype=bool)
    inner |= not inner.any()
    there = np.bincount(classes[inner], minlength=int(classes.max()) + 1) > 0
    n_kept, n_inner = int(there.sum()), int(inner.sum())
    if n_kept > _MOST_CLASSES or (n_kept > 1 and 2 * n_kept > n_inner) or _graded(mesh, classes, there):
        return None
    return np.where(there, np.arange(len(there)), -1)[classes]


def _classes(mesh: Mesh) -> Ints:
    """Return the class of each element, shape (n_elements,): its form, regardless of the order of its nodes."""
    forms = mesh.forms
    at = mesh.nodes[mesh.elements[forms.first]]
    places = rounded(at - at.mean(axis=1, keepdims=True), forms.size)
    order = np.lexsort(np.moveaxis(places, -1, 0)[::-1], axis=-1)
    canonical = np.take_along_axis(places, order[:, :, None], axis=1).reshape(len(at), -1)
    return np.asarray(distinct_rows(canonical.T).of[forms.of])


def _at_boundary(mesh: Mesh) -> Bools:
    """Return whether each element has a boundary facet, shape (n_elements,)."""
    touched = np.zeros(mesh.n_nodes, dtype=bool)
    touched[mesh.boundary] = True
    return np.asarray(touched[mesh.elements].sum(axis=1) >= mesh.boundary.shape[1])


def _graded(mesh: Mesh, classes: Ints, there: Bools) -> bool:
    """Return whether one of the classes `there` occurs only in a part of the body."""
    if len(there) == 1:
        return False
    order = np.argsort(classes, kind="stable")
    starts = np.searchsorted(classes[order], np.arange(len(there)))
    for along, reach in zip(mesh.centres.T, mesh.forms.largest, strict=True):
        ordered = along[order]
        extents = np.maximum.reduceat(ordered, starts) - np.minimum.reduceat(ordered, starts)
        if (extents[there] < ordered.max() - ordered.min() - 2.5 * reach).any():
            return True
    return False


def lattice_elasticity(problem: Problem, stiffness: Floats, classes: Ints | None) -> Floats:
    """Return the elasticity matrix of springs under a uniform strain [Pa], in Voigt's order, shape (3, 3) or (6, 6).

    C_ijkl V = sum k L^2 n_i n_j n_k n_l (Born and Huang, Dynamical Theory of Crystal Lattices, 1954), with the
    `stiffness` of each element's links [N/m], shape (n_elements, links). For a lattice, the mean over its classes; for
    other meshes, the mean over all elements, an upper bound since the nodes do not relax.
    """
    mesh, section = problem.mesh, problem.section
    assert section is not None  # see require_body
    chosen = np.arange(len(mesh.elements))
    if classes is not None:
        chosen = np.unique(classes, return_index=True)[1]
        chosen = chosen[classes[chosen] >= 0]
    pairs = voigt_pairs(mesh.dim)
    energy = np.zeros((len(pairs), len(pairs)))
    for numbers, block in mesh.blocks:
        of_kind = chosen if len(mesh.blocks) == 1 else np.flatnonzero(np.isin(numbers, chosen))
        own_stiffness = stiffness if len(mesh.blocks) == 1 else stiffness[numbers, : len(block.kind.links)]
        for part in slices(len(of_kind), 16 * own_stiffness.shape[1] * len(pairs)):
            own = of_kind[part]
            across = link_vectors(block, own).reshape(-1, mesh.dim)
            strain = np.stack([across[:, i] * across[:, j] for i, j in pairs], axis=1)
            energy += strain.T @ ((own_stiffness[own].ravel() / (across**2).sum(axis=1))[:, None] * strain)
    return np.asarray(energy / (mesh.measures[chosen].sum() * section.thickness))


def hooke(lam: float, mu: float, dim: int) -> Floats:
    """Return the isotropic elasticity matrix of Lamé constants [Pa], in Voigt's order, shape (3, 3) or (6, 6)."""
    n_shear = dim * (dim - 1) // 2
    elasticity = np.zeros((dim + n_shear, dim + n_shear))
    elasticity[:dim, :dim] = lam
    return elasticity + np.diag([2 * mu] * dim + [mu] * n_shear)
