"""The V-cycle of multigrid.

It is symmetric: a forward Gauss-Seidel sweep on the way down, a backward sweep on the way up. Blocks of the finest
level are in single precision, which halves the memory traffic.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from truespring.arrays import Floats
from truespring.linear.levels import Level, Matrix


class Transfer(Protocol):
    """Prolongation P from a coarser level to a finer one, zero in held directions."""

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of vectors on the finer and on the coarser level, (n, k) both."""
        ...

    @property
    def n_bytes(self) -> int:
        """Memory of the arrays [bytes]."""
        ...

    def restrict(self, fine: Floats, coarse: Floats) -> None:
        """Write P^T fine to `coarse`; `fine` may be overwritten."""
        ...

    def prolong(self, coarse: Floats, fine: Floats) -> None:
        """Add P coarse to `fine`."""
        ...


@dataclass(eq=False)
class Hierarchy:
    """The coarser levels.

    Attributes:
        transfers: prolongation to the finest level, then to each coarser one.
        levels: the coarser levels that are smoothed; the coarsest is not among them if it has an inverse.
        inverse: inverse of the coarsest matrix, shape (n, n); None if the coarsest level is only smoothed, as its nodes
            have no strong neighbours.
    """

    transfers: Sequence[Transfer]
    levels: list[Level]
    inverse: Floats | None

    @cached_property
    def _room(self) -> list[tuple[Floats, Floats, Floats]]:
        """Two vectors for each level and one for the next, allocated once: allocation is slow."""
        shapes = [transfer.shape for transfer in self.transfers]
        return [(np.empty(fine), np.empty(fine), np.empty(coarse)) for fine, coarse in shapes]

    @property
    def n_bytes(self) -> int:
        """Memory of all levels [bytes]."""
        transfers = sum(transfer.n_bytes for transfer in self.transfers)
        dense = 0 if self.inverse is None else self.inverse.nbytes
        return dense + transfers + sum(level.n_bytes for level in self.levels)

    def cycle(self, finest: Level, residual: Floats) -> Floats:
        """Return an approximate solution z [m] of A z = residual by one V-cycle, shape (n_nodes, dim).

        The next cycle overwrites it.
        """
        return self._cycle(0, finest, residual)

    def _cycle(self, depth: int, level: Level, r: Floats) -> Floats:
        """Return an approximate solution on the level `depth`."""
        from truespring.kernels import blocks

        coarsest = depth == len(self.transfers)
        if coarsest and self.inverse is not None:
            solution = np.empty(r.size)
            blocks.dense(0, r.size, self.inverse, r.ravel(), solution)
            return solution.reshape(r.shape)
        z, left, coarse = (np.empty(r.shape), np.empty(r.shape), r) if coarsest else self._room[depth]
        level.run(blocks.sweep_forward, level.inverse, level.added, r, z, left)
        if not coarsest:
            level.across(blocks.subtract_across, z, left)
            self.transfers[depth].restrict(left, coarse)
            coarser = self.levels[depth] if depth < len(self.levels) else level
            self.transfers[depth].prolong(self._cycle(depth + 1, coarser, coarse), z)
        left[:] = r
        level.across(blocks.subtract_across, z, left)
        level.run(blocks.sweep_backward, level.inverse, level.added, left, z)
        return z


class Coarsening(Protocol):
    """A way to make coarse levels."""

    @property
    def name(self) -> str:
        """Name of multigrid with these levels, for notes and reports."""
        ...

    @property
    def stale(self) -> bool:
        """Whether the next tangent gets new levels."""
        ...

    @property
    def n_bytes(self) -> int:
        """Memory of the levels [bytes]."""
        ...

    def hierarchy(
        self, level: Level, tangent: Matrix, scale: float, positions: Floats, positive: bool
    ) -> Hierarchy | None:
        """Return the coarse levels of a tangent times `scale` at positions [m], whose `level` is the finest.

        None if a diagonal block is not positive definite; `positive` states whether those of the tangent are.
        """
        ...

    def after(self, pace: float) -> "Coarsening":
        """Return the way for the next tangent, after one took `pace` iterations for two digits of accuracy."""
        ...
