"""Identifiability of unknowns: rank and singular values of the derivative of the data."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats

# Singular values below this share of the largest are zero; equilibria are about as accurate.
_ZERO = 1e-9
# An unknown with a larger share than this in the null space is not determined.
_LOOSE = 1e-6
# For more unknowns than this singular values are not computed.
_MOST = 3000
# Number of unknowns that the sentence names.
_NAMED = 5


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Which unknowns the data determine, to first order.

    Attributes:
        names: of the unknowns.
        rank: number of combinations of unknowns that the data determine; None if there are too many unknowns.
        singular_values: of the derivative of the relative data by the unknowns, descending, shape (n,); rounding
            errors are zero.
        undetermined: share of each unknown in the null space of the data, shape (n,).
        resolution: share of each unknown that is determined by the data, not by the regularisation, shape (n,).
        of: the data of the derivative in words.
    """

    names: tuple[str, ...]
    rank: int | None
    singular_values: Floats
    undetermined: Floats
    resolution: Floats
    of: str

    @property
    def n_unknowns(self) -> int:
        """The number of unknowns."""
        return len(self.names)

    @property
    def determined(self) -> bool | None:
        """Whether the data alone determine all unknowns; None if unknown."""
        return None if self.rank is None else self.rank == self.n_unknowns

    @property
    def loose(self) -> tuple[str, ...]:
        """The unknowns that the data alone do not determine."""
        return tuple(name for name, share in zip(self.names, self.undetermined, strict=True) if share > _LOOSE)

    @property
    def weak(self) -> tuple[str, ...]:
        """The unknowns that the regularisation determines more than the data."""
        return tuple(name for name, share in zip(self.names, self.resolution, strict=True) if share < 0.5)

    @property
    def sentence(self) -> str:
        """The result in one or two sentences."""
        n = self.n_unknowns
        if self.rank is None:
            return f"Whether the data determine the {n} unknowns was not computed: there are more than {_MOST}."
        if self.rank == n:
            condition = self.singular_values[0] / self.singular_values[-1]
            every = f"all {n} unknowns" if n > 1 else "the unknown"
            text = f"The data determine {every} (rank {n} of {n}, condition {condition:.1e})."
        else:
            text = (
                f"The data do not determine all unknowns: rank {self.rank} of {n}; {len(self.loose)} unknowns are not "
                f"determined individually ({_some(self.loose)}). The regularisation toward the rule fixes the rest; "
                "use more load cases or fewer unknowns."
            )
        weak = len(self.weak)
        if weak and self.rank == n:
            few = f"{weak} of them {'is' if weak == 1 else 'are'}"
            text += f" But {few} determined more by the regularisation than by the data: {_some(self.weak)}."
        return text


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:_NAMED]) + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")


def identifiability(matrix: Floats, names: Sequence[str], regularisation: float, of: str) -> Identifiability:
    """Return the identifiability of unknowns from the derivative `matrix` of relative data, shape (n_data, n).

    The resolution is the diagonal of V s^2 / (s^2 + regularisation^2 / n) V^T with the singular values s (Backus and
    Gilbert; Menke, Geophysical Data Analysis).
    """
    n = len(names)
    if n > _MOST:
        return Identifiability(tuple(names), None, np.zeros(0), np.zeros(n), np.ones(n), of)
    reduced = np.linalg.qr(matrix, mode="r") if matrix.shape[0] > n else matrix
    values, right = np.linalg.svd(reduced, full_matrices=False)[1:]
    there = values > _ZERO * values.max(initial=0.0)
    seen = right[there] ** 2
    squared = values[there] ** 2
    share = squared / (squared + regularisation**2 / n)
    padded = np.zeros(n)
    padded[: len(values)] = np.where(there, values, 0.0)
    undetermined = np.clip(1 - seen.sum(axis=0), 0.0, 1.0)
    return Identifiability(tuple(names), int(there.sum()), padded, undetermined, share @ seen, of)
