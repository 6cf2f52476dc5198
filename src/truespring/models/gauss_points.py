"""The Gauss points of a slice of finite elements in a deformed state, and the integrals over them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.fibres import Families
from truespring.models.elasticity_parts import Elasticity, of_tensor
from truespring.models.law import Constants, Frame
from truespring.models.strain import voigt_pairs
from truespring.models.symmetric import contracted, identity, inverted, trace, voigt_places

# Smallest number of blocks of elements for which threads share a slice.
_SMALLEST_PIECE = 4


class Exchange(NamedTuple):
    """The replacement of the volume ratio at the Gauss points by the mean of each element.

    Attributes:
        J: volume ratio, axes (point, element); 1 for a linear law.
        theta: ln(Jm / J), Jm the mean of J over the undeformed element; for a linear law the change of the trace.
        scale: factor exp(2 theta / d) of C; 1 for a linear law, NaN in an inverted element.
        reference: `scale` where stresses have axes of the reference, 1 where they are current: S times it is the
            stress at the deformation of the element.
        metric: C in axes of the reference, else the identity, axes (component, point, element) or of length 1.
        inverse: inverse of `metric`, the derivative of ln J with respect to the strain.
    """

    J: Floats
    theta: Floats
    scale: Floats
    reference: Floats
    metric: Floats
    inverse: Floats


@dataclass(frozen=True, eq=False)
class Points:
    """The Gauss points of a slice of the elements in a deformed state.

    The slice is filled up with its last element to a multiple of the elements that kernels treat at a time. In all
    frames the change of the energy density is S : d, with d the symmetric part of A^T grad u, where A = F and grad u
    is the undeformed gradient in the frame "reference", A = I otherwise, and grad u is the current gradient in the
    frame "current". The same A and gradient make the Hessian from the elasticity, A^T grad u : D : A^T grad v, and the
    stress, S : (grad u^T grad v) (Bonet and Wood, Nonlinear Continuum Mechanics); the linear law has no such part.

    Attributes:
        frame: the axes of stresses, strains and elasticities.
        count: number of elements of the slice, not those that fill it up.
        elements: nodes of each element, shape (n, k).
        gradients: gradients of the shape functions [1/m], axes (block, row, lane), see `kernels.elements`.
        volumes: undeformed volume of each point [m^3], axes (point, element).
        F: deformation gradient [-], axes (i, j, point, element).
        J: its determinant [-], axes (point, element).
        strain: the strain of the frame [-], axes (component, point, element).
        constants: constants of the law.
        fibres: fibres of the elements; None without.
    """

    frame: Frame
    count: int
    elements: Ints
    gradients: Floats
    volumes: Floats
    F: Floats
    J: Floats
    strain: Floats
    constants: Constants
    fibres: Families | None

    @property
    def dim(self) -> int:
        """The dimension of space."""
        return len(self.F)

    @cached_property
    def _voigt(self) -> Ints:
        return voigt_places(self.dim)

    @property
    def _turned(self) -> bool:
        """Whether A is not the identity."""
        return self.frame == "reference"

    def _run(self, kernel: Any, *arguments: Any) -> None:
        """Run a kernel over all blocks of elements; arrays of several axes become rows of elements."""
        from truespring.kernels.lanes import LANES
        from truespring.kernels.threads import run

        run(kernel, len(self.elements) // LANES, *arguments, smallest=_SMALLEST_PIECE)

    def _rows(self, values: Floats) -> Floats:
        """Return an array of any axes, the last one the elements, as rows of elements."""
        from truespring.kernels.threads import writable

        return writable(values).reshape(-1, len(self.elements))

    @property
    def _zero(self) -> tuple[float, ...]:
        return (0.0,) * self.dim

    def strain_change(self, step: Floats) -> Floats:
        """Return d of a step u [m], shape (n_nodes, dim); axes (component, point, element)."""
        from truespring.kernels import elements
        from truespring.kernels.threads import writable

        change = np.empty((len(voigt_pairs(self.dim)), *self.volumes.shape))
        known = (writable(step), self.elements, self.gradients, self._rows(self.F), self._turned)
        self._run(elements.strain_changes, *known, self._voigt, self._rows(change), self._zero)
        return change

    def forces(self, stress: Floats) -> Floats:
        """Return the nodal forces of a stress [N], shape (k * dim, n), node by node."""
        from truespring.kernels import elements

        force = np.empty((self.elements.shape[1] * self.dim, len(self.elements)))
        known = (self._rows(self.F), self._turned, self._rows(stress), self._voigt, self.gradients)
        self._run(elements.forces, *known, self.volumes, force, self._zero)
        return force

    def matrices(
        self, stress: Floats, elasticity: Elasticity, along: Floats | None = None, across: Floats | None = None
    ) -> Floats:
        """Return the matrices of a stress and an elasticity [N/m] as pairs of nodes, see `kernels.elements`.

        Adds a b^T + b a^T, a and b the columns of `along` and `across`, shape (k * dim, n).
        """
        from truespring.kernels import elements
        from truespring.kernels.lanes import LANES
        from truespring.kernels.threads import writable

        k, dim, n = self.elements.shape[1], self.dim, len(self.elements)
        none = np.empty((0, n))
        pairs = np.empty((n // LANES, k * (k + 1) // 2 * dim * dim, LANES))
        geometric = np.zeros(stress.shape) if self.frame == "small" else stress
        shape = self.volumes.shape
        plain = [writable(np.broadcast_to(one, shape)) for one in (elasticity.alike, elasticity.shear)]
        parts = [none if one is None else self._rows(one) for one in (elasticity.coupled, elasticity.rest)]
        known = (self._rows(self.F), self._turned, self._rows(geometric), *plain, *parts, self._voigt)
        spread = (none, none) if along is None or across is None else (self._rows(along), self._rows(across))
        integrals = (self.gradients, self.volumes, *spread)
        self._run(elements.stiffnesses, *known, *integrals, pairs, self._zero, self._zero * dim)
        return pairs

    def from_reference(self, stress: Floats, F: Floats) -> Floats:
        """Return a second Piola-Kirchhoff stress at F in this frame [Pa], axes (component, point, element)."""
        return self._transformed(stress, F, inverse=False)

    def to_reference(self, stress: Floats, F: Floats) -> Floats:
        """Return a stress of this frame as second Piola-Kirchhoff stress at F [Pa]; that of the linear law as it is."""
        return self._transformed(stress, F, inverse=True)

    def _transformed(self, stress: Floats, F: Floats, inverse: bool) -> Floats:
        from truespring.kernels import elements

        if self.frame != "current":
            return stress
        result = np.empty(stress.shape)
        known = (self._rows(F), self._rows(stress), inverse, self._voigt, self._rows(result))
        self._run(elements.congruences, *known, self._zero)
        return result

    def mean(self, values: Floats) -> Floats:
        """Return the mean over each undeformed element, axes (1, element)."""
        return np.asarray((values * self.volumes).sum(axis=0, keepdims=True) / self.volumes.sum(axis=0, keepdims=True))

    @cached_property
    def exchange(self) -> Exchange:
        """The replacement of the volume ratio by its mean over each undeformed element."""
        eye = identity(self.strain)
        if self.frame == "small":
            own = trace(self.strain)
            ones = np.ones_like(own)
            return Exchange(ones, self.mean(own) - own, ones, ones, eye, eye)
        valid = (self.J > 0).all(axis=0, keepdims=True)
        J = np.where(valid, self.J, 1.0)
        theta = np.log(self.mean(J) / J)
        scale = np.where(valid, np.exp(2 * theta / self.dim), np.nan)
        if self.frame == "current":
            return Exchange(J, theta, scale, np.ones_like(J), eye, eye)
        metric = np.where(valid, self.strain, eye)
        return Exchange(J, theta, scale, scale, metric, inverted(metric))

    def own(self, values: Floats) -> Floats:
        """Return values, the last axis the elements, without those of the elements that fill up the slice."""
        return values[..., : self.count]

    def inverse(self, strain: Floats) -> Floats | None:
        """Return C^-1 in axes of the frame, axes (component, point, element); None if it is the identity.

        `strain` is C, in the frame "reference".
        """
        return inverted(strain) if self.frame == "reference" else None

    def pressure_of(self, stress: Floats, strain: Floats) -> Floats:
        """Return the Kirchhoff pressure of a stress [Pa], positive in tension, axes (point, element)."""
        whole = contracted(stress, strain) if self.frame == "reference" else trace(stress)
        return whole / self.dim

    def of_metric(self, alike: Floats | float, shear: Floats | float, strain: Floats) -> Elasticity:
        """Return alike M (x) M + shear (M_ik M_jl + M_il M_jk) [Pa], M given by `inverse`."""
        inverse = self.inverse(strain)
        return Elasticity(alike, shear) if inverse is None else of_tensor(alike, shear, inverse)


def determinant(F: Floats) -> Floats:
    """Return the determinant of tensors of axes (i, j, ...), axes (...), in their unit to the power of dim."""
    if len(F) == 2:
        return np.asarray(F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])
    minors = [F[1, j] * F[2, k] - F[1, k] * F[2, j] for j, k in ((1, 2), (2, 0), (0, 1))]
    return np.asarray(F[0, 0] * minors[0] + F[0, 1] * minors[1] + F[0, 2] * minors[2])
