"""The frame in which a linear elastic block strains: at rest, or turning with the block (corotated)."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from truespring.arrays import Floats
from truespring.models.block import Block


class Tangent(NamedTuple):
    """The tangent stiffness of a block [N/m].

    Attributes:
        surface: between nodes of the surface, shape (n_surface, dim, n_surface, dim).
        inside: from nodes of the surface to those inside, shape (n_surface, dim, n_inside, dim).
        alone: of each node inside with itself, the same in every direction and for every node.
    """

    surface: Floats
    inside: Floats
    alone: float


class Frame(Protocol):
    """From positions to the displacement that strains a block, and back from its forces; [m], [N], (n_nodes, dim)."""

    @property
    def block(self) -> Block:
        """The block."""
        ...

    def displacement(self, positions: Floats) -> Floats:
        """What strains the block."""
        ...

    def change(self, positions: Floats, step: Floats) -> Floats:
        """The change of it that is linear in a step of the positions."""
        ...

    def gradient(self, positions: Floats, force: Floats) -> Floats:
        """The derivative of the energy by the positions from that by the displacement."""
        ...

    def tangent(self, positions: Floats, force: Floats) -> Tangent:
        """The second derivative; zero forces leave what is positive semidefinite."""
        ...


@dataclass(frozen=True, eq=False)
class AtRest:
    """The frame of linear elasticity: the block takes a turn for strain."""

    block: Block

    def displacement(self, positions: Floats) -> Floats:
        """Positions less those at rest."""
        return positions - self.block.nodes

    def change(self, positions: Floats, step: Floats) -> Floats:
        """The step."""
        return step

    def gradient(self, positions: Floats, force: Floats) -> Floats:
        """The force."""
        return force

    def tangent(self, positions: Floats, force: Floats) -> Tangent:
        """The stiffness of the block."""
        return Tangent(*_coupled(self.block), self.block.kappa)


def _turned_by(rotation: Floats, blocks: Floats) -> Floats:
    """Blocks R A R^T of a matrix, of shape (n, dim, m, dim)."""
    n, dim, m, _ = blocks.shape
    return (rotation @ blocks.reshape(n, dim, m * dim)).reshape(n, dim, m, dim) @ rotation.T


def _coupled(block: Block) -> tuple[Floats, Floats]:
    n, dim = len(block.surface), block.nodes.shape[1]
    surface, inside = block.coupled
    return surface.reshape(n, dim, n, dim), inside.reshape(n, dim, -1, dim)


class _Turned(NamedTuple):
    """A block's rotation at some positions.

    Attributes:
        rotation: R, turns the block at rest nearest to the positions.
        arms: positions from the middle of the surface, turned back [m], shape (n_nodes, dim).
        rates: of the spins omega by the positions of the surface [1/m], shape (m, n_surface, dim).
        flexibility: D^-1 [1/m^2], shape (m, m).
        stretch: S = R^T M [m^2].
    """

    rotation: Floats
    arms: Floats
    rates: Floats
    flexibility: Floats
    stretch: Floats


@dataclass(frozen=True, eq=False)
class Turning:
    """A frame that turns with the block: R^T x - X strains it, with R the rotation that fits its surface best.

    R is the polar rotation of M = sum x X^T over the nodes of the surface, both from their middle: atan2 in the plane.
    Its derivatives are exact. With the unit spins A_k, one in the plane and three in space, R changes by
    R sum omega_k A_k, where D omega = (A_k : R^T dM), D_kl = A_k : A_l S, S = R^T M.
    """

    block: Block

    @cached_property
    def _at_rest(self) -> Floats:
        """Reference positions from the middle of the surface [m], shape (n_nodes, dim)."""
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
        except np.linalg.LinAlgError:  # a block turned inside out may have no nearest rotation
            flexibility = np.full_like(resistance, np.nan)
        rates = np.einsum("kl,lij,aj->kai", flexibility, R @ spins, X)
        return _Turned(R, x @ R, rates, flexibility, S)

    def _resistance(self, stretch: Floats) -> Floats:
        """D of S, or of many, axes (..., m, m)."""
        return np.asarray(np.einsum("kij,...lij->...kl", self._spins, self._spins @ stretch[..., None, :, :]))

    def displacement(self, positions: Floats) -> Floats:
        """R^T x - X, both from the middle of the surface."""
        return self._turned(positions).arms - self._at_rest

    def change(self, positions: Floats, step: Floats) -> Floats:
        """R^T dx, and what the change of R does to the arms."""
        at = self._turned(positions)
        omega = np.einsum("kai,ai->k", at.rates, step[: at.rates.shape[1]])
        return np.asarray(step @ at.rotation + self._swung(at.arms) @ omega)

    def _swung(self, arms: Floats) -> Floats:
        """How a unit of each spin changes what is seen from the frame, shape (n_nodes, dim, m)."""
        return np.asarray(np.einsum("kji,aj->aik", self._spins, arms))

    def gradient(self, positions: Floats, force: Floats) -> Floats:
        """R f, and the work of f on the arms as R changes."""
        at = self._turned(positions)
        gradient = force @ at.rotation.T
        work = np.einsum("aik,ai->k", self._swung(at.arms), force)
        gradient[: at.rates.shape[1]] += np.einsum("k,kai->ai", work, at.rates)
        return np.asarray(gradient)

    def tangent(self, positions: Floats, force: Floats) -> Tangent:
        """The stiffness turned with the frame and through its spins, and the forces times the second derivatives."""
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
        """The second derivative by M of R : P, from R^T P, axes (i, j, k, l) of two changes of M.

        The first is R sum z_k A_k with D z = (A_k : R^T P); this is its change with M.
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
