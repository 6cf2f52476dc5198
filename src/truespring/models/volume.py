"""The area or volume term of springs, with which an isotropic lattice has any Poisson's ratio from 0 on."""

from dataclasses import dataclass
from functools import cached_property, partial
from math import factorial

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.assembly import Pattern
from truespring.problem import Problem

# Threads share the elements of a slice from so many on.
_SMALLEST_PIECE = 256


@dataclass(frozen=True, eq=False)
class VolumeTerm:
    """Energy kappa/2 V0 (V / V0 - 1)^2 of each element, V its signed area times thickness, or volume.

    `kappa` [Pa], shape (n_elements,). Golec et al., The Visual Computer 36 (2020), for cubes.
    """

    problem: Problem
    kappa: Floats

    @cached_property
    def pattern(self) -> Pattern:
        """Where the elements stand in a matrix."""
        return Pattern(self.problem.mesh.elements, *self.problem.mesh.nodes.shape)

    @cached_property
    def _at_rest(self) -> Floats:
        return self._volumes(self.problem.mesh.nodes)

    @cached_property
    def _form(self) -> tuple[Ints, float]:
        """The simplices of an element, and by what the sum of their determinants is multiplied."""
        section, kind = self.problem.section, self.problem.mesh.kind
        assert section is not None  # the springs beside it need one
        return np.array(kind.simplices), section.thickness * kind.simplex_weight / factorial(kind.dim)

    def _volumes(self, positions: Floats) -> Floats:
        """Signed volume of each element [m^3]; of a plane one area times thickness."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import run, writable

        volume = np.empty(len(self.kappa))
        known = (writable(positions), self.pattern.elements, *self._form)
        run(volumes.volumes, len(volume), *known, volume, self.pattern.zero)
        return volume

    def element_energies(self, positions: Floats) -> Floats:
        """Stored energy of each element [J], shape (n_elements,)."""
        return np.asarray(self.kappa / 2 * self._at_rest * (self._volumes(positions) / self._at_rest - 1) ** 2)

    def pressure(self, positions: Floats) -> Floats:
        """kappa (V / V0 - 1), positive in tension [Pa], shape (n_elements,)."""
        return np.asarray(self.kappa * (self._volumes(positions) / self._at_rest - 1))

    def extrapolated_pressure(self, positions: Floats, step: Floats) -> Floats:
        """The pressure carried on linearly along `step` [m], in Pa, shape (n_elements,)."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import run, writable

        growth = np.empty(len(self.kappa))
        known = (writable(positions), writable(step), self.pattern.elements, *self._form)
        run(volumes.growths, len(growth), *known, growth, self.pattern.zero)
        return self.pressure(positions) + self.kappa * growth / self._at_rest

    def element_forces(self, positions: Floats) -> Floats:
        """Internal force on the nodes of each element [N], shape (n_elements, nodes * dim)."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import run, writable

        pattern, pressure = self.pattern, self.pressure(positions)
        force = np.empty((len(pressure), pattern.elements.shape[1] * pattern.dim))
        known = (writable(positions), pattern.elements, *self._form, pressure)
        run(volumes.forces, len(force), *known, force, pattern.zero)
        return force

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        return self.pattern.vector(self.element_forces(positions))

    def add_hessian(self, positions: Floats, pressure: Floats, values: Floats) -> None:
        """Add the tangent stiffness [N/m], the curvature of the volumes weighted by `pressure` [Pa], to a matrix."""
        from truespring.kernels.threads import writable

        self.pattern.add(partial(self._matrices, writable(positions), self.kappa, writable(pressure)), values)

    def add_projected_hessian(self, positions: Floats, values: Floats) -> None:
        """Add what of it is positive semidefinite everywhere: the stiffness against a change of volume [N/m]."""
        from truespring.kernels.threads import writable

        stiff = np.maximum(self.kappa, 0.0)
        self.pattern.add(partial(self._matrices, writable(positions), stiff, np.zeros_like(stiff)), values)

    def stiffening(self, positions: Floats, first: int = 0, last: int | None = None) -> Floats:
        """Stiffness of elements against a change of their volume [N/m], shape (n, n_dof, n_dof)."""
        from truespring.kernels.threads import writable

        end = len(self.kappa) if last is None else last
        return self._matrices(writable(positions), self.kappa, np.zeros(len(self.kappa)), first, end)

    def _matrices(self, positions: Floats, kappa: Floats, pressure: Floats, first: int, last: int) -> Floats:
        """Element matrices of a slice [N/m], shape (last - first, n_dof, n_dof)."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import run

        here = slice(first, last)
        elements, stiffness = self.pattern.elements[here], kappa[here] / self._at_rest[here]
        n_dof = elements.shape[1] * self.pattern.dim
        blocks = np.empty((last - first, n_dof, n_dof))
        known = (positions, elements, *self._form, stiffness, pressure[here])
        run(volumes.stiffnesses, last - first, *known, blocks, self.pattern.zero, smallest=_SMALLEST_PIECE)
        return blocks
