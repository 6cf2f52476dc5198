"""Elements whose volume changes as a whole: they do not lock where the material is nearly incompressible."""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.models.fem import FemPotential, determinant, true_stress
from truespring.models.laws import Response


class _Volumetric(NamedTuple):
    """What the exchange of the volume ratio adds, at the Gauss points.

    Attributes:
        F: deformation gradient, axes (i, j, element, point); the identity for a linear law.
        stress: stress S' by which the law answers to a change of F at a constant ratio [Pa].
        elasticity: its elasticity by the Green strain [Pa].
        pressure: derivative p of the energy density by theta = ln(mean J / J) [Pa].
        mixed: derivative of p by the right Cauchy-Green tensor, times 2 [Pa], axes (i, j, element, point).
        second: second derivative of the energy density by theta [Pa].
    """

    F: Floats
    stress: Floats
    elasticity: Floats
    pressure: Floats
    mixed: Floats
    second: Floats


class MeanDilatationPotential(FemPotential):
    """Quadrilaterals and hexahedra whose volume ratio J is replaced at every point by the element's own.

    The law is asked at (Jm / J)^(1/d) F with the mean Jm of J over the element at rest and d the
    dimensions: the mean dilatation method of Nagtegaal, Parks and Rice (CMAME 4, 1974), at finite
    strain that of Simo, Taylor and Pister (CMAME 51, 1985) with the pressure eliminated. For the
    linear law it is the trace of the strain that is averaged (Hughes' B-bar).
    """

    interpolation = "mean-dilatation"

    def _exchanged(self, positions: Floats) -> tuple[Floats, Floats, Floats]:
        """The true deformation gradient, its J (1 for a linear law), and theta, axes (element, point)."""
        F = self._deformation(positions)
        if not self.law.finite:
            trace = np.einsum("ii...->...", F) - len(F)
            return F, np.ones_like(trace), self._mean(trace) - trace
        J = determinant(F)
        if (J <= 0).any():
            return F, J, np.full_like(J, np.nan)
        return F, J, np.log(self._mean(J) / J)

    def _mean(self, values: Floats) -> Floats:
        """The mean over each element at rest, axes (element, 1)."""
        return np.asarray((values * self.volumes).sum(axis=1, keepdims=True) / self.volumes.sum(axis=1, keepdims=True))

    def _respond(self, positions: Floats) -> tuple[Floats, Response]:
        """The exchanged deformation gradient and the law's response to it."""
        key = positions.tobytes()
        if self._last.get("key") != key:
            F, J, theta = self._exchanged(positions)
            dim = len(F)
            if self.law.finite:
                F_bar = np.exp(theta / dim) * F
                strain = np.einsum("ki...,kj...->ij...", F_bar, F_bar)
                strain = np.where(np.isnan(theta), np.eye(dim)[:, :, None, None], strain)
            else:
                F_bar = F
                strain = (F + F.swapaxes(0, 1)) / 2 + (theta / dim - 1) * np.eye(dim)[:, :, None, None]
            self._last.update(
                key=key, F=F, J=J, theta=theta, F_bar=F_bar, response=self.law.respond(strain, self.constants)
            )
        return self._last["F_bar"], self._last["response"]

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]; infinite where an element is inverted: its volume ratio has no logarithm there."""
        with np.errstate(over="ignore", invalid="ignore"):
            _, response = self._respond(positions)
        if np.isnan(self._last["theta"]).any() or not np.isfinite(response.energy).all():
            return float("inf")
        return float((response.energy * self.volumes).sum())

    def _volumetric(self, positions: Floats) -> _Volumetric:
        _, response = self._respond(positions)
        F, theta, dim = self._last["F"], self._last["theta"], self.mesh.dim
        if not self.law.finite:
            eye = np.eye(dim)
            mixed = np.einsum("ijkleq,kl->ijeq", response.elasticity, eye) / dim
            second = np.einsum("ijeq,ij->eq", mixed, eye) / dim
            pressure = np.einsum("ii...->...", response.stress) / dim
            identity = np.broadcast_to(eye[:, :, None, None], F.shape)
            return _Volumetric(identity, response.stress, response.elasticity, pressure, mixed, second)
        C = np.einsum("ki...,kj...->ij...", F, F)
        stress = np.exp(2 * theta / dim) * response.stress
        elasticity = np.exp(4 * theta / dim) * response.elasticity
        pressure = np.einsum("ij...,ij...->...", stress, C) / dim
        stiffening = np.einsum("ijkl...,kl...->ij...", elasticity, C) / dim
        mixed = 2 * stress / dim + stiffening
        second = 2 / dim * pressure + np.einsum("ij...,ij...->...", stiffening, C) / dim
        return _Volumetric(F, stress, elasticity, pressure, mixed, second)

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        at = self._volumetric(positions)
        J = self._last["J"]
        inverse = _inverse_transposed(at.F)
        share = self._mean(at.pressure) / self._mean(J) * J - at.pressure
        own = np.einsum("ik...,kj...->ij...", at.F, at.stress) if self.law.finite else at.stress
        return self._summed(own + share * inverse)

    def element_hessians(self, positions: Floats, stress: Floats | None = None) -> Floats:
        """Tangent stiffness of each element [N/m], shape (n_elements, n_dof, n_dof), dofs node by node.

        With h the derivative of ln J and t that of theta by the nodes: beside the tangent of the law
        c t^T + t c^T + W'' t t^T, c from `mixed`, and where the law is finite what the second
        derivatives of ln Jm and ln J add. `stress` is not used.
        """
        at = self._volumetric(positions)
        J, w = self._last["J"], self.volumes
        blocks = self._tangent(at.F, at.stress, at.elasticity)
        size = blocks.shape[1]

        def nodal(first: Floats) -> Floats:
            return self.nodal(first).reshape(*J.shape, size)

        h = nodal(_inverse_transposed(at.F))
        mean_J = self._mean(J)
        m = np.einsum("eq,eqi->ei", w * J, h) / (w.sum(axis=1, keepdims=True) * mean_J)  # derivative of ln Jm
        t = m[:, None] - h
        c = nodal(np.einsum("ik...,kj...->ij...", at.F, at.mixed))
        mixed = _summed(w, c, t)
        blocks += mixed + mixed.swapaxes(1, 2) + _summed(w * at.second, t, t)
        if self.law.finite:
            p = self._mean(at.pressure) * w.sum(axis=1, keepdims=True)
            grown = p * w * J / (w.sum(axis=1, keepdims=True) * mean_J)
            n_local, dim = size // self.mesh.dim, self.mesh.dim
            turned = _summed(w * at.pressure - grown, h, h).reshape(-1, n_local, dim, n_local, dim)
            blocks += turned.swapaxes(2, 4).reshape(blocks.shape) + _summed(grown, h, h)
            blocks -= p[:, :, None] * m[:, :, None] * m[:, None, :]
        return np.asarray(blocks)

    def cauchy_stress(self, positions: Floats) -> Floats:
        """True stress averaged over the points of each element [Pa], shape (n_elements, 3, 3)."""
        F_bar, response = self._respond(positions)
        return true_stress(F_bar, response, self.law.finite)


def _summed(weight: Floats, left: Floats, right: Floats) -> Floats:
    """Sum of weighted outer products over the points, shapes (n, points), (n, points, k) twice, to (n, k, k)."""
    return np.asarray((weight[:, :, None] * left).swapaxes(1, 2) @ right)


def _inverse_transposed(F: Floats) -> Floats:
    inverse = np.linalg.inv(np.moveaxis(F, (0, 1), (-2, -1)))
    return np.asarray(np.moveaxis(inverse, (-1, -2), (0, 1)))
