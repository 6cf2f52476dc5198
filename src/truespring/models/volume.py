"""The area or volume term of springs, which gives an isotropic lattice any Poisson's ratio from 0 to 0.5."""

from dataclasses import dataclass
from functools import cached_property, partial
from math import factorial
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.assembly import Pattern
from truespring.models.element_volumes import ElementVolumes
from truespring.potential import VolumeStiffness
from truespring.problem import Problem

# Smallest number of elements for which threads share a slice.
_SMALLEST_PIECE = 256


@dataclass(frozen=True, eq=False)
class VolumeTerm:
    """The energy kappa/2 V0 (V / V0 - 1)^2 of each element, V its signed area times thickness, or volume.

    Source, for cubes: Golec et al., The Visual Computer 36 (2020).

    Attributes:
        problem: mesh, material and section.
        kappa: modulus [Pa], shape (n_elements,).
    """

    problem: Problem
    kappa: Floats

    @cached_property
    def pattern(self) -> Pattern:
        """The sparsity pattern of the elements."""
        return Pattern(self.problem.mesh.elements, *self.problem.mesh.nodes.shape)

    @cached_property
    def _at_rest(self) -> Floats:
        return self._volumes(self.problem.mesh.nodes)

    @cached_property
    def _form(self) -> tuple[Ints, float]:
        """The simplices of an element, and the factor of the sum of their determinants [-] or [m]."""
        section, kind = self.problem.section, self.problem.mesh.kind
        assert section is not None  # required by springs
        return np.array(kind.simplices), section.thickness * kind.simplex_weight / factorial(kind.dim)

    @property
    def arrays(self) -> dict[str, Any]:
        """Modulus [Pa] and undeformed volume [m^3], shape (n_elements,), and the simplices of an element."""
        kind = self.problem.mesh.kind
        of_kind = {"simplices": np.array(kind.simplices), "simplex_weight": np.array(kind.simplex_weight)}
        return {"kappa": self.kappa, "volume": self._at_rest, **of_kind}

    def _volumes(self, positions: Floats) -> Floats:
        """Return the signed volume of each element [m^3], area times thickness in 2D, shape (n_elements,)."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import run, writable

        volume = np.empty(len(self.kappa))
        known = (writable(positions), self.pattern.elements, *self._form)
        run(volumes.volumes, len(volume), *known, volume, self.pattern.zero)
        return volume

    def element_energies(self, positions: Floats) -> Floats:
        """Return the stored energy of each element [J], shape (n_elements,)."""
        return np.asarray(self.kappa / 2 * self._at_rest * (self._volumes(positions) / self._at_rest - 1) ** 2)

    def pressure(self, positions: Floats) -> Floats:
        """Return kappa (V / V0 - 1), positive in tension [Pa], shape (n_elements,)."""
        return np.asarray(self.kappa * (self._volumes(positions) / self._at_rest - 1))

    def extrapolated_pressure(self, positions: Floats, step: Floats) -> Floats:
        """Return the pressure extrapolated linearly along `step` [m], in Pa, shape (n_elements,)."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import run, writable

        growth = np.empty(len(self.kappa))
        known = (writable(positions), writable(step), self.pattern.elements, *self._form)
        run(volumes.growths, len(growth), *known, growth, self.pattern.zero)
        return self.pressure(positions) + self.kappa * growth / self._at_rest

    def element_forces(self, positions: Floats) -> Floats:
        """Return the internal force on the nodes of each element [N], shape (n_elements, nodes * dim)."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import run, writable

        pattern, pressure = self.pattern, self.pressure(positions)
        force = np.empty((len(pressure), pattern.elements.shape[1] * pattern.dim))
        known = (writable(positions), pattern.elements, *self._form, pressure)
        run(volumes.forces, len(force), *known, force, pattern.zero)
        return force

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        return self.pattern.vector(self.element_forces(positions))

    def add_hessian(self, positions: Floats, pressure: Floats, values: Floats) -> None:
        """Add the tangent stiffness [N/m] to the values of a matrix; `pressure` [Pa] gives the geometric part."""
        from truespring.kernels.threads import writable

        self.pattern.add(partial(self._matrices, writable(positions), self.kappa, writable(pressure)), values)

    def add_projected_hessian(self, positions: Floats, values: Floats) -> None:
        """Add the positive semidefinite part: the stiffness against volume change of elements with kappa > 0 [N/m]."""
        from truespring.kernels.threads import writable

        stiff = np.maximum(self.kappa, 0.0)
        self.pattern.add(partial(self._matrices, writable(positions), stiff, np.zeros_like(stiff)), values)

    @cached_property
    def _measures(self) -> ElementVolumes:
        return ElementVolumes(self.problem, self.pattern.elements, 1)

    def volume_stiffness(self, positions: Floats) -> tuple[VolumeStiffness, ...]:
        """Return the second derivative of the energy by the volume of each element, and the material's mu likewise."""
        slope, volume = self._measures.at(positions)
        shear = self.problem.of_elements(lambda material: material.lame.mu) * self._at_rest / volume**2
        return (VolumeStiffness(self.pattern.elements, slope, self.kappa / self._at_rest, shear),)

    def stiffening(self, positions: Floats, first: int = 0, last: int | None = None) -> Floats:
        """Return the stiffness of elements against volume change [N/m], shape (n, n_dof, n_dof)."""
        from truespring.kernels.threads import writable

        end = len(self.kappa) if last is None else last
        return self._matrices(writable(positions), self.kappa, np.zeros(len(self.kappa)), first, end)

    def _matrices(self, positions: Floats, kappa: Floats, pressure: Floats, first: int, last: int) -> Floats:
        """Return the element matrices of a slice [N/m], shape (last - first, n_dof, n_dof)."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import run

        here = slice(first, last)
        elements, stiffness = self.pattern.elements[here], kappa[here] / self._at_rest[here]
        n_dof = elements.shape[1] * self.pattern.dim
        blocks = np.empty((last - first, n_dof, n_dof))
        known = (positions, elements, *self._form, stiffness, pressure[here])
        run(volumes.stiffnesses, last - first, *known, blocks, self.pattern.zero, smallest=_SMALLEST_PIECE)
        return blocks
