"""Weights of Gaussian springs: the scalar Laplacian of an element, with a free stiffness of its hourglass modes."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError
from truespring.mesh import Mesh, square_stretch_forms
from truespring.mesh.rows import distinct_rows
from truespring.models.fem_potential import FemPotential, fem_of_one_kind
from truespring.models.links import CORNERS
from truespring.problem import Problem, sample

#: Kinds of elements with hourglass modes, and the value of `hourglass` at and below which a regular element has a mode
#: without stiffness.
HOURGLASS_LIMITS: Mapping[str, float] = MappingProxyType({"quadrilateral": 0.0, "hexahedron": 0.5})

#: Default of `hourglass` on lattices of bricks with a stepped surface, such as voxels.
STEPPED_HOURGLASS = 1.2
#: Weight below which nodes are joined by no spring, over the largest: rounding.
ROUNDING = 1e-12

# Hourglass modes of a hexahedron, the products yz, xz, xy and xyz of its corners' signs, shape (8, 4).
_SIGNS = 2.0 * CORNERS - 1
_MODES = np.stack([*(np.delete(_SIGNS, axis, axis=1).prod(axis=1) for axis in range(3)), _SIGNS.prod(axis=1)], axis=1)


def default_hourglass(problem: Problem, poisson: float) -> float:
    """Return the default of `hourglass` for a material on the mesh of a problem; see docs/hourglass.md."""
    if problem.mesh.dim == 2:
        return 1.0
    return STEPPED_HOURGLASS if problem.mesh.is_stepped else 1 / (1 + poisson**2)


def hourglass_values(problem: Problem, hourglass: float | None) -> Floats:
    """Return `hourglass` of each element, shape (n_elements,): the given value, or the default for its material."""
    if hourglass is not None:
        return np.full(len(problem.mesh.elements), float(hourglass))
    return problem.of_elements(lambda material: default_hourglass(problem, material.poisson))


def check_hourglass(mesh: Mesh, hourglass: float | None) -> None:
    """Raise ModelError if `hourglass` has no effect on a mesh, or if a mode of a brick would have no stiffness."""
    if hourglass is None:
        return
    limits = [HOURGLASS_LIMITS[kind] for kind in mesh.element_kinds if kind in HOURGLASS_LIMITS]
    if not limits:
        raise ModelError(
            f"hourglass = {hourglass:g} has no effect on {mesh.kinds} elements: remove it, or use "
            f"{' or '.join(HOURGLASS_LIMITS)} elements"
        )
    if not max(limits) < hourglass < np.inf:
        raise ModelError(
            f"hourglass = {hourglass:g}: a mode of {mesh.kinds} elements has no stiffness at or below "
            f"{max(limits):g}; 1 is the stiffness of finite elements"
        )


class Laplacians(NamedTuple):
    """The quadratic forms of elements, by classes of equal ones.

    Attributes:
        matrices: [m], in 2D thickness times a number, shape (n_forms, n_classes, nodes, nodes); rows sum to zero.
        of: the class of each element, shape (n_elements,).
    """

    matrices: Floats
    of: Ints


def laplacians(problem: Problem, hourglass: Floats, along: Floats | None = None) -> Laplacians:
    """Return the scalar Laplacian of each element for a unit modulus, and the forms of fibres; elements of one kind.

    The off-diagonal entries are minus the weights of the springs between the nodes. With the mean gradients b of the
    shape functions over the volume V0, the part V0 b b^T determines the energy of uniform strain; the rest, the
    integral of grad N . grad N minus that part, is the stiffness of the hourglass modes of finite elements.

    Args:
        problem: mesh and section.
        hourglass: stiffness of the hourglass modes over that of finite elements, shape (n_elements,).
        along: unit vectors along fibres, shape (n_families, n_elements, dim); each family has a further form, the
            integral of (grad N_a . a)(grad N_b . a).
    """
    forms = problem.mesh.forms
    if not forms.few:
        return Laplacians(_forms(problem, hourglass, along), np.arange(len(hourglass)))
    columns = [forms.of, _numbered(hourglass[:, None])]
    columns += [] if along is None else [_numbered(one) for one in along]
    kinds = distinct_rows(tuple(columns))
    part = None if along is None else along[:, kinds.first]
    return Laplacians(_forms(sample(problem, kinds.first), hourglass[kinds.first], part), kinds.of)


def _numbered(rows: Floats) -> Ints:
    """Return the number of each row among the distinct ones, shape (n,)."""
    if (rows == rows[:1]).all():
        return np.zeros(len(rows), dtype=np.int64)
    return np.asarray(np.unique(rows, axis=0, return_inverse=True)[1]).ravel()


def _forms(problem: Problem, hourglass: Floats, along: Floats | None) -> Floats:
    """Return the Laplacian of each element and the forms of fibres, shape (n_forms, n_elements, nodes, nodes)."""
    found, mesh, section = [_laplacians(problem, hourglass)], problem.mesh, problem.section
    assert section is not None  # see require_body
    for one in () if along is None else along:
        form = square_stretch_forms(mesh.kind.vtk, mesh.nodes, mesh.elements, one)
        found.append(section.thickness * form)
    return np.stack(found)


def _laplacians(problem: Problem, hourglass: Floats) -> Floats:
    """Return the Laplacian of each element, shape (n_elements, nodes, nodes), slice by slice."""
    whole = integrated(fem_of_one_kind(problem, "linear"), lambda gradients: gradients)
    kind = problem.mesh.element
    if kind not in HOURGLASS_LIMITS:
        return whole
    gradients, volumes = fem_of_one_kind(problem, "linear").quadrature()
    means = np.einsum("eq,eqai->eai", volumes, gradients)
    uniform = means @ means.swapaxes(1, 2) / volumes.sum(axis=1)[:, None, None]
    rest = whole - uniform
    if kind == "quadrilateral":
        return np.asarray(uniform + hourglass[:, None, None] * rest)
    at = problem.mesh.nodes[problem.mesh.elements]
    slopes = means / volumes.sum(axis=1)[:, None, None]
    modes = _MODES - slopes @ (at.swapaxes(1, 2) @ _MODES)  # no part of a uniform strain (Flanagan and Belytschko 1981)
    inverse = np.linalg.pinv(modes)
    stiffness = inverse @ rest @ inverse.swapaxes(1, 2)
    scale = np.sqrt(np.stack([*[hourglass] * 3, np.maximum(1.0, 3 - 2 * hourglass)], axis=1))
    scaled = modes * scale[:, None]
    return np.asarray(uniform + scaled @ stiffness @ scaled.swapaxes(1, 2))


def integrated(potential: FemPotential, along: Callable[[Floats], Floats]) -> Floats:
    """Return the integral of g_i . g_j over each element, shape (n_elements, nodes, nodes).

    `along` returns g from the gradients of the shape functions, axes (element, point, node, direction).
    """
    found = []
    for first, last in potential.slices():
        gradients, volumes = potential.quadrature(first, last)
        g = along(gradients)
        weighted = (volumes[:, :, None, None] * g).swapaxes(1, 2).reshape(len(g), g.shape[2], -1)
        found.append(weighted @ g.swapaxes(1, 2).reshape(weighted.shape).swapaxes(1, 2))
    return np.concatenate(found)
