"""The elasticity of a law at Gauss points, in parts of which most laws have few."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.models.symmetric import contracted, dimensions, identity, outer, swapped, trace


@dataclass(frozen=True, slots=True)
class Elasticity:
    """D = alike I (x) I + shear (I_ik I_jl + I_il I_jk) + T (x) I + I (x) T + rest, by components in Voigt's order.

    A shear component of a strain stands for both e_xy and e_yx.

    Attributes:
        alike, shear: [Pa], of shapes that broadcast to the axes of elements and points.
        coupled: the symmetric tensor T [Pa], axes (component, ...); None if there is none.
        rest: [Pa], axes (component, component, ...); None if there is none.
    """

    alike: Floats | float
    shear: Floats | float
    coupled: Floats | None = None
    rest: Floats | None = None

    def times(self, strain: Floats) -> Floats:
        """Return D : strain [Pa], axes (component, ...)."""
        dim, grown = dimensions(strain), trace(strain)
        result = 2 * np.asarray(self.shear) * strain
        result[:dim] += self.alike * grown
        if self.coupled is not None:
            result += grown * self.coupled
            result[:dim] += contracted(self.coupled, strain)
        return result if self.rest is None else result + contracted(self.rest, strain)

    def plus(self, other: "Elasticity") -> "Elasticity":
        """Return the sum of two elasticities."""
        coupled = _sum(self.coupled, other.coupled)
        return Elasticity(self.alike + other.alike, self.shear + other.shear, coupled, _sum(self.rest, other.rest))

    def scaled(self, factor: Floats) -> "Elasticity":
        """Return this elasticity times a factor, axes (...)."""
        coupled, rest = (None if one is None else factor * one for one in (self.coupled, self.rest))
        return Elasticity(factor * self.alike, factor * self.shear, coupled, rest)

    def dense(self, like: Floats) -> Floats:
        """Return all components [Pa], axes (component, component, ...) as a symmetric tensor `like` has."""
        eye = np.broadcast_to(identity(like), like.shape)
        result = self.alike * outer(eye, eye) + self.shear * swapped(eye)
        if self.coupled is not None:
            mixed = outer(np.broadcast_to(self.coupled, like.shape), eye)
            result += mixed + mixed.swapaxes(0, 1)
        return np.asarray(result if self.rest is None else result + self.rest)


def of_tensor(alike: Floats | float, shear: Floats | float, tensor: Floats) -> Elasticity:
    """Return alike M (x) M + shear (M_ik M_jl + M_il M_jk) of a symmetric tensor M, axes (component, ...)."""
    return Elasticity(0.0, 0.0, rest=np.asarray(alike * outer(tensor, tensor) + shear * swapped(tensor)))


def _sum(one: Floats | None, other: Floats | None) -> Floats | None:
    """Return the sum of two tensors; None is zero."""
    if one is None or other is None:
        return one if other is None else other
    return np.asarray(one + other)
