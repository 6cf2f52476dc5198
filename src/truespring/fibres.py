"""Fibres of a material: their directions in the body, and the constants of their energy."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import FibreError, ProblemError, nearest
from truespring.mesh import Mesh

#: Direction of one family of fibres: a vector, or the name of an array of the mesh with a vector for each element.
Direction = str | tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Fibres:
    """Fibres of a material, in one family or several; they bear tension only.

    The energy density of a family with the stretch sqrt(I4) is k1 / (2 k2) (exp(k2 <I4 - 1>^2) - 1), <x> the positive
    part of x; for k2 = 0 its limit, k1 / 2 <I4 - 1>^2. Young's modulus along straight fibres increases by 4 k1 at
    small tension. Source: Holzapfel, Gasser, Ogden, Journal of Elasticity 61, 2000.

    Attributes:
        along: direction in the undeformed body: a vector of any length, one number for each direction of space; or the
            name of an array of `Mesh.element_vectors`; for several families a list of these. Stored as a tuple of
            families.
        k1: stiffness [Pa], not negative; 0 for fibres without stiffness, which may have an active tension.
        k2: increase of the stiffness with the stretch [-], not negative; requires k1 above 0.

    Example:
        >>> import truespring as ts
        >>> ts.Fibres(along=(1.0, 0.0), k1=5e3, k2=10.0).words()
        'fibres along (1, 0), k1 = 5000 Pa, k2 = 10'
    """

    along: str | Sequence[float] | Sequence[str | Sequence[float]]
    k1: float = 0.0
    k2: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "along", _families(self.along))
        for name, value, unit in (("k1", self.k1, " Pa"), ("k2", self.k2, "")):
            if not (math.isfinite(value) and value >= 0):
                raise ProblemError(f"fibres: {name} = {value!r}{unit}: must be finite and not negative")
        if self.k2 and not self.k1:
            raise ProblemError(f"fibres: k2 = {self.k2:g} requires k1 above 0: set k1, or remove k2")

    @property
    def families(self) -> tuple[Direction, ...]:
        """The direction of each family: a vector, or the name of an array of the mesh."""
        return self.along  # type: ignore[return-value]  # see __post_init__

    def words(self) -> str:
        """Return the fibres in words: "fibres along (1, 0), k1 = 5000 Pa, k2 = 10"."""
        named = [
            f"'{one}'" if isinstance(one, str) else f"({', '.join(f'{x:.4g}' for x in one)})" for one in self.families
        ]
        return f"fibres along {' and '.join(named)}, k1 = {self.k1:g} Pa, k2 = {self.k2:g}"

    def directions(self, mesh: Mesh, elements: Ints) -> Floats:
        """Return unit vectors along the fibres of `elements`, shape (n_families, n, dim).

        Raises ProblemError if the mesh has no such array, or if a direction is zero or does not lie in the body.
        """
        return np.stack([_unit_vectors(family, mesh, elements) for family in self.families])

    def turned(self, rotation: Floats) -> "Fibres":
        """Return the fibres of a body rotated by a matrix of shape (dim, dim); names of arrays stay."""
        along = [one if isinstance(one, str) else tuple((rotation @ np.array(one)).tolist()) for one in self.families]
        return Fibres(along, self.k1, self.k2)


def _families(along: object) -> tuple[Direction, ...]:
    """Return the directions of the families; raise ProblemError for anything but vectors and names."""
    several: Iterable[object] = along if isinstance(along, Sequence | np.ndarray) and not isinstance(along, str) else ()
    several = list(several)
    if not several or (np.ndim(several[0]) == 0 and not isinstance(several[0], str)):  # type: ignore[arg-type]
        several = [along]
    return tuple(one if isinstance(one, str) else _vector(one) for one in several)


def _vector(value: object) -> tuple[float, ...]:
    try:
        vector = tuple(float(one) for one in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        vector = ()
    if len(vector) not in (2, 3) or not all(map(math.isfinite, vector)):
        raise ProblemError(
            f"fibres: along = {value!r}: give a vector of 2 or 3 numbers, the name of an array of the mesh, or a list "
            "of these"
        )
    if not any(vector):
        raise ProblemError(f"fibres: along = {list(vector)}: the direction has length zero")
    return vector


def _unit_vectors(family: Direction, mesh: Mesh, elements: Ints) -> Floats:
    """Return the unit vectors of a family, shape (n, dim)."""
    if not isinstance(family, str):
        if len(family) != mesh.dim:
            raise ProblemError(
                f"fibres: along = {list(family)} has {len(family)} numbers, the body has {mesh.dim} directions"
            )
        return np.tile(np.array(family) / np.linalg.norm(family), (len(elements), 1))
    there = mesh.element_vectors
    if family not in there:
        names = ", ".join(there) or "this mesh has none"
        raise ProblemError(
            f"fibres: along = '{family}' is no array of vectors of the mesh's elements{nearest(family, there)}; "
            f"arrays: {names}"
        )
    vectors = there[family][elements]
    length = np.linalg.norm(vectors, axis=1)
    within = np.linalg.norm(vectors[:, : mesh.dim], axis=1)
    for bad, why in (
        (~(length > 0) | ~np.isfinite(length), "is zero or not finite"),
        (within < (1 - 1e-6) * length, "points out of the plane of the body"),
    ):
        if bad.any():
            first = int(bad.argmax())
            raise ProblemError(
                f"fibres: along = '{family}': the vector {vectors[first].tolist()} of element {elements[first]} {why}; "
                f"so {'does' if bad.sum() == 1 else 'do'} {int(bad.sum())} of {len(bad)}: put elements without fibres "
                "into a region of a material without fibres"
            )
    return np.asarray(vectors[:, : mesh.dim] / within[:, None])


@dataclass(frozen=True, eq=False)
class Families:
    """The fibres of the elements of a body, in families.

    Attributes:
        directions: unit vectors, shape (n_families, n_elements, dim); zero if an element has fewer families.
        k1: stiffness [Pa], shape (n_elements,).
        k2: increase of the stiffness [-], shape (n_elements,).
    """

    directions: Floats
    k1: Floats
    k2: Floats

    def of(self, numbers: Ints | slice) -> "Families":
        """Return the fibres of elements."""
        return Families(self.directions[:, numbers], self.k1[numbers], self.k2[numbers])


def families(mesh: Mesh, fibres: Sequence[Fibres | None], numbers: Ints) -> Families | None:
    """Return the fibres of the elements of a mesh; None if there are none.

    Args:
        mesh: the mesh.
        fibres: the fibres of each material.
        numbers: index of the material of each element, shape (n_elements,).

    Raises FibreError if a direction is missing, zero, or not in the body.
    """
    n_families = max((len(one.families) for one in fibres if one is not None), default=0)
    if not n_families:
        return None
    directions = np.zeros((n_families, len(numbers), mesh.dim))
    k1, k2 = np.zeros(len(numbers)), np.zeros(len(numbers))
    for number, one in enumerate(fibres):
        if one is not None:
            own = np.flatnonzero(numbers == number)
            try:
                directions[: len(one.families), own] = one.directions(mesh, own)
            except ProblemError as error:
                raise FibreError(one, str(error)) from None
            k1[own], k2[own] = one.k1, one.k2
    return Families(directions, k1, k2)
