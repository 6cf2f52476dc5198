"""The elasticity that the springs of a mesh have together, before anything moves."""

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.mesh import Mesh
from truespring.models.links import link_vectors
from truespring.models.strain import voigt_pairs
from truespring.problem import Problem

# A mesh made of so few kinds of elements, up to translation, is a lattice: 12 make the body-centred-cubic one,
# and divisions about several diagonals some more.
_MOST_CLASSES = 48

# Places in elements that differ by less than this share of the element's size are the same.
_SAME_PLACE = 1e-5


def affine_energies(problem: Problem, stiffness: Floats) -> Floats:
    """Return C V of each element [J], shape (n_elements, 3 or 6, 3 or 6), in Voigt's order.

    Springs of `stiffness` [N/m], shape (n_elements, links), that follow a uniform strain:
    C_ijkl V = sum k L^2 n_i n_j n_k n_l.
    """
    across = link_vectors(problem.mesh)
    length = np.linalg.norm(across, axis=2)
    n = across / length[:, :, None]
    strain = np.stack([n[..., i] * n[..., j] for i, j in voigt_pairs(problem.mesh.dim)], axis=-1)
    return np.asarray(np.einsum("el,eli,elj->eij", stiffness * length**2, strain, strain, optimize=True))


def lattice_classes(mesh: Mesh) -> Ints | None:
    """Return the class of each element, -1 for those at the boundary that the inside does not have; None if no lattice.

    Two elements are of one class where a translation carries one into the other, whatever the order of
    their nodes. A lattice has few, each all over the body; at its boundary there may be others.
    """
    at = mesh.nodes[mesh.elements]
    size = np.ptp(at, axis=1).max(axis=1)
    # The offset keeps places that lie on the border of two roundings, as halves and quarters do, on one side.
    places = np.round((at - at.mean(axis=1, keepdims=True)) / size.mean() / _SAME_PLACE + 0.3137).astype(np.int64)
    order = np.lexsort(np.moveaxis(places, -1, 0)[::-1], axis=-1)
    canonical = np.take_along_axis(places, order[:, :, None], axis=1).reshape(len(at), -1)
    _, classes, count = np.unique(canonical, axis=0, return_inverse=True, return_counts=True)
    classes = classes.ravel()
    # Only tetrahedra have lattices that a plane cannot cut without elements of another kind.
    inner = ~_at_boundary(mesh) if mesh.element == "tetrahedron" else np.ones(len(at), dtype=bool)
    kept = np.unique(classes[inner]) if inner.any() else np.arange(len(count))
    n_inner = int(inner.sum()) or len(at)
    if len(kept) > _MOST_CLASSES or (len(kept) > 1 and 2 * len(kept) > n_inner):
        return None
    centres, reach = at.mean(axis=1), np.ptp(at, axis=1).max(axis=0)
    for one in kept:  # graded meshes have classes that fill a part of the body only
        if (np.ptp(centres[classes == one], axis=0) < np.ptp(centres, axis=0) - 2.5 * reach).any():
            return None
    return np.where(np.isin(classes, kept), classes, -1)


def _at_boundary(mesh: Mesh) -> Bools:
    """Whether each element has a facet that bounds the body, shape (n_elements,)."""
    touched = np.zeros(mesh.n_nodes, dtype=bool)
    touched[mesh.boundary] = True
    return np.asarray(touched[mesh.elements].sum(axis=1) >= mesh.boundary.shape[1])


def lattice_elasticity(problem: Problem, energies: Floats, classes: Ints | None) -> Floats:
    """Return the elasticity [Pa] in Voigt's order, shape (3, 3) or (6, 6), from `affine_energies`.

    Of a lattice the mean over its classes, each counted alike; of other meshes over all elements, a
    bound from above, since nodes that do not follow a uniform strain relax.
    """
    section = problem.section
    assert section is not None  # require_body was asked
    volumes = problem.mesh.measures * section.thickness
    if classes is None:
        return np.asarray(energies.sum(axis=0) / volumes.sum())
    _, first = np.unique(classes, return_index=True)
    first = first[classes[first] >= 0]
    return np.asarray(energies[first].sum(axis=0) / volumes[first].sum())


def hooke(lam: float, mu: float, dim: int) -> Floats:
    """Return the isotropic elasticity of Lamé's constants [Pa] in Voigt's order, shape (3, 3) or (6, 6)."""
    n_shear = dim * (dim - 1) // 2
    elasticity = np.zeros((dim + n_shear, dim + n_shear))
    elasticity[:dim, :dim] = lam
    return elasticity + np.diag([2 * mu] * dim + [mu] * n_shear)
