"""The frame of reference of a linear elastic block: fixed, or rotating with the block (corotated)."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from truespring.arrays import Floats
from truespring.models.block import Block


class Tangent(NamedTuple):
    """The tangent stiffness of a block, in parts [N/m].

    Attributes:
        surface: between surface nodes, shape (n_surface, dim, n_surface, dim).
        inside: between surface nodes and inner nodes, shape (n_surface, dim, n_inside, dim).
        alone: diagonal of the inner nodes, a number.
    """

    surface: Floats
    inside: Floats
    alone: float


class Frame(Protocol):
    """Maps positions to the displacement in the frame of the block, and forces back; [m], [N], shape (n_nodes, dim)."""

    @property
    def block(self) -> Block:
        """The block in this frame."""
        ...

    def displacement(self, positions: Floats) -> Floats:
        """Return the displacement in the frame of the block [m], shape (n_nodes, dim)."""
        ...

    def change(self, positions: Floats, step: Floats) -> Floats:
        """Return the linear change of this displacement for a step of the positions [m], shape (n_nodes, dim)."""
        ...

    def gradient(self, positions: Floats, force: Floats) -> Floats:
        """Return the forces on the nodes [N], shape (n_nodes, dim), from the forces in the frame."""
        ...

    def tangent(self, positions: Floats, force: Floats) -> Tangent:
        """Return the tangent stiffness for forces in the frame; positive semidefinite if they are zero."""
        ...


@dataclass(frozen=True, eq=False)
class AtRest:
    """The fixed frame of linear elasticity: a rotation of the block causes strain."""

    block: Block

    def displacement(self, positions: Floats) -> Floats:
        """Return the displacement from the undeformed positions [m], shape (n_nodes, dim)."""
        return positions - self.block.nodes

    def change(self, positions: Floats, step: Floats) -> Floats:
        """Return the step [m], shape (n_nodes, dim)."""
        return step

    def gradient(self, positions: Floats, force: Floats) -> Floats:
        """Return the force [N], shape (n_nodes, dim)."""
        return force

    def tangent(self, positions: Floats, force: Floats) -> Tangent:
        """Return the stiffness of the block."""
        return Tangent(*_coupled(self.block), self.block.kappa)


def _turned_by(rotation: Floats, blocks: Floats) -> Floats:
    """Return R A R^T for the blocks A of a matrix, shape (n, dim, m, dim)."""
    n, dim, m, _ = blocks.shape
    return (rotation @ blocks.reshape(n, dim, m * dim)).reshape(n, dim, m, dim) @ rotation.T


def _coupled(block: Block) -> tuple[Floats, Floats]:
    """Return `Block.coupled` in blocks, shapes (n_surface, dim, n_surface, dim) and (n_surface, dim, n_inside, dim)."""
    n, dim = len(block.surface), block.nodes.shape[1]
    surface, inside = block.coupled
    return surface.reshape(n, dim, n, dim), inside.reshape(n, dim, -1, dim)


class _Turned(NamedTuple):
    """The rotation of a block and its derivatives at given positions; m spins, one in 2D and three in 3D.

    Attributes:
        rotation: R, the rotation of the undeformed block that fits the positions best, shape (dim, dim).
        arms: positions relative to the centre of the surface, rotated back [m], shape (n_nodes, dim).
        rates: derivative of the spins omega with respect to the surface positions [1/m], shape (m, n_surface, dim).
        flexibility: D^-1 [1/m^2], shape (m, m).
        stretch: S = R^T M [m^2], shape (dim, dim).
    """

    rotation: Floats
    arms: Floats
    rates: Floats
    flexibility: Floats
    stretch: Floats


@dataclass(frozen=True, eq=False)
class Turning:
    """A frame that rotates with the block: the displacement in it is R^T x - X, R the rotation that fits it best.

    R is the rotation in the polar decomposition of M = sum x X^T over the surface nodes, x and X relative to their
    centres; atan2 in 2D. Its derivatives are exact: with the unit spins A_k, one in 2D and three in 3D,
    dR = R sum omega_k A_k, where D omega = (A_k : R^T dM), D_kl = A_k : A_l S, S = R^T M.
    """

    block: Block

    @cached_property
    def _at_rest(self) -> Floats:
        """Undeformed positions relative to the centre of the surface [m], shape (n_nodes, dim)."""
        nodes = self.block.nodes
        return np.asarray(nodes - nodes[: len(self.block.surface)].mean(axis=0))

    @cached_property
    def _spins(self) -> Floats:
        """The unit spins A_k, shape (m, dim, dim)."""
        dim = self.block.nodes.shape[1]
        pairs = ((0, 1),) if dim == 2 else ((1, 2), (2, 0), (0, 1))
        spins = np.zeros((len(pairs), dim, dim))
        for spin, (i, j) in zip(spins, pairs, strict=True):
            spin[j, i], spin[i, j] = 1.0, -1.0
        return spins

    def _turned(self, positions: Floats) -> _Turned:
        n, spins = len(self.block.surface), self._spins
        x, X = positions - positions[:n].mean(axis=0), self._at_rest[:n]
        M = x[:n].T @ X
        left, _, right = np.linalg.svd(M)
        left[:, -1] *= np.sign(np.linalg.det(left @ right))
        R = left @ right
        S = R.T @ M
        resistance = self._resistance(S)
        try:
            flexibility = np.asarray(np.linalg.inv(resistance), dtype=np.float64)
        except np.linalg.LinAlgError:  # an inverted block may have no best rotation
            flexibility = np.full_like(resistance, np.nan)
        rates = np.einsum("kl,lij,aj->kai", flexibility, R @ spins, X)
        return _Turned(R, x @ R, rates, flexibility, S)

    def _resistance(self, stretch: Floats) -> Floats:
        """Return D for S, axes (..., m, m)."""
        return np.asarray(np.einsum("kij,...lij->...kl", self._spins, self._spins @ stretch[..., None, :, :]))

    def displacement(self, positions: Floats) -> Floats:
        """Return R^T x - X [m], both relative to the centre of the surface, shape (n_nodes, dim)."""
        return self._turned(positions).arms - self._at_rest

    def change(self, positions: Floats, step: Floats) -> Floats:
        """Return R^T dx plus the change of the arms with R [m], shape (n_nodes, dim)."""
        at = self._turned(positions)
        omega = np.einsum("kai,ai->k", at.rates, step[: at.rates.shape[1]])
        return np.asarray(step @ at.rotation + self._swung(at.arms) @ omega)

    def _swung(self, arms: Floats) -> Floats:
        """Return the change of the arms for unit spins [m], shape (n_nodes, dim, m)."""
        return np.asarray(np.einsum("kji,aj->aik", self._spins, arms))

    def gradient(self, positions: Floats, force: Floats) -> Floats:
        """Return R f plus the work of f on the arms as R changes [N], shape (n_nodes, dim)."""
        at = self._turned(positions)
        gradient = force @ at.rotation.T
        work = np.einsum("aik,ai->k", self._swung(at.arms), force)
        gradient[: at.rates.shape[1]] += np.einsum("k,kai->ai", work, at.rates)
        return np.asarray(gradient)

    def tangent(self, positions: Floats, force: Floats) -> Tangent:
        """Return the stiffness in the rotated frame, with the derivatives of the rotation of first and second order."""
        at = self._turned(positions)
        R, rates, n = at.rotation, at.rates, at.rates.shape[1]
        surface, inside = (_turned_by(R, one) for one in _coupled(self.block))
        swung = self._swung(at.arms)
        resisting = self.block.forces(swung)
        of_spins = np.einsum("aik,ail->kl", swung, resisting)
        beside = np.einsum("ij,ajk->kai", R, resisting) + np.einsum("kij,aj->kai", R @ self._spins, force)
        half = beside[:, :n] + np.einsum("kl,lai->kai", of_spins, rates) / 2
        both = np.einsum("kai,kbj->aibj", rates, half)
        surface += both + both.transpose(2, 3, 0, 1)
        X = self._at_rest[:n]
        curvature = self._curvature(at, at.arms.T @ force)
        surface += np.einsum("aj,ijbk->aibk", X, np.einsum("ijkl,bl->ijbk", curvature, X))
        inside += np.einsum("kai,kbj->aibj", rates, beside[:, n:])
        return Tangent(surface, inside, self.block.kappa)

    def _curvature(self, at: _Turned, turned: Floats) -> Floats:
        """Return the second derivative of R : P with respect to M, from `turned` = R^T P, axes (i, j, k, l).

        The first derivative is R sum z_k A_k with D z = (A_k : R^T P); this is its derivative.
        """
        spins, R, dim = self._spins, at.rotation, len(at.rotation)
        seen = R.T @ np.eye(dim * dim).reshape(-1, dim, dim)  # R^T dM of unit changes of M
        omega = np.einsum("kl,lij,cij->ck", at.flexibility, spins, seen)
        spin = np.einsum("ck,kij->cij", omega, spins)
        z = at.flexibility @ np.einsum("kij,ij->k", spins, turned)
        change = -np.einsum("kij,cij->ck", spins, spin @ turned)
        change -= self._resistance(seen - spin @ at.stretch) @ z
        change = change @ at.flexibility
        slopes = R @ (spin @ np.einsum("k,kij->ij", z, spins) + np.einsum("ck,kij->cij", change, spins))
        return np.asarray(slopes.reshape(dim, dim, dim, dim).transpose(2, 3, 0, 1))
