"""Symmetric tensors as components in Voigt's order: the component axis first, then axes of elements and points."""

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.models.strain import voigt_pairs


def voigt_places(dim: int) -> Ints:
    """Return the number of the component of each pair of axes, shape (dim, dim)."""
    places = np.empty((dim, dim), dtype=np.int64)
    for place, (i, j) in enumerate(voigt_pairs(dim)):
        places[i, j] = places[j, i] = place
    return places


def dimensions(tensor: Floats) -> int:
    """Return the dimension of a symmetric tensor, axes (component, ...)."""
    return {3: 2, 6: 3}[len(tensor)]


def identity(tensor: Floats) -> Floats:
    """Return the identity [-] with as many axes as a symmetric tensor, axes (component, 1, ...)."""
    ones = np.arange(len(tensor)) < dimensions(tensor)
    return ones.astype(np.float64).reshape(-1, *[1] * (tensor.ndim - 1))


def trace(tensor: Floats) -> Floats:
    """Return the trace of a symmetric tensor, axes (...), in its unit."""
    return np.asarray(tensor[: dimensions(tensor)].sum(axis=0))


def contracted(left: Floats, right: Floats) -> Floats:
    """Return left : right over the last tensor axis of `left`, shear counted twice: axes of `left` without it."""
    dim = dimensions(right)
    total = sum((1 if at < dim else 2) * left[..., at, :, :] * component for at, component in enumerate(right))
    return np.asarray(total)


def outer(left: Floats, right: Floats) -> Floats:
    """Return the product left_ij right_kl, axes (component, component, ...); units multiply."""
    return np.asarray(left[:, None] * right[None])


def swapped(tensor: Floats) -> Floats:
    """Return tensor_im tensor_jn + tensor_in tensor_jm, axes (component ij, component mn, ...), in its unit squared."""
    at = voigt_places(dimensions(tensor))
    pairs = voigt_pairs(dimensions(tensor))
    result = np.empty((len(pairs), *tensor.shape))
    for one, (i, j) in enumerate(pairs):
        for two, (m, n) in enumerate(pairs[: one + 1]):
            result[one, two] = tensor[at[i, m]] * tensor[at[j, n]] + tensor[at[i, n]] * tensor[at[j, m]]
            result[two, one] = result[one, two]
    return result


def dyad(a: Floats, b: Floats) -> Floats:
    """Return the symmetric tensor a_i b_j + a_j b_i of two vectors, axes (direction, ...); units multiply."""
    return np.stack([a[i] * b[j] + a[j] * b[i] for i, j in voigt_pairs(len(a))])


def determinant(tensor: Floats) -> Floats:
    """Return the determinant of a symmetric tensor, axes (...), in its unit to the power of dim."""
    if len(tensor) == 3:
        xx, yy, xy = tensor
        return np.asarray(xx * yy - xy**2)
    xx, yy, zz, yz, xz, xy = tensor
    return np.asarray(xx * (yy * zz - yz**2) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz))


def inverted(tensor: Floats) -> Floats:
    """Return the inverse of a symmetric tensor [1 / its unit], axes (component, ...); not finite if singular."""
    if len(tensor) == 3:
        xx, yy, xy = tensor
        return _ratio(np.stack([yy, xx, -xy]), determinant(tensor))
    xx, yy, zz, yz, xz, xy = tensor
    cofactors = [
        *(yy * zz - yz**2, xx * zz - xz**2, xx * yy - xy**2),
        *(xy * xz - xx * yz, xy * yz - yy * xz, yz * xz - zz * xy),
    ]
    return _ratio(np.stack(cofactors), determinant(tensor))


def _ratio(cofactors: Floats, determinant: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(cofactors / determinant)
