"""Which unknowns data determine: rank and singular values of how the data answer to them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats

# Singular values below this share of the largest are zero: equilibria are found to about so much.
_ZERO = 1e-9
# An unknown of which more than this share lies among what no datum sees is not determined.
_LOOSE = 1e-6
# Of more unknowns than this the singular values are not computed.
_MOST = 3000
# So many unknowns are named.
_NAMED = 5


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What data tell of unknowns, to first order.

    Attributes:
        names: of the unknowns.
        rank: the number of their combinations that the data determine; None where they are too many to look at.
        singular_values: of the relative data's derivative by the unknowns, descending; rounding counts as zero.
        undetermined: share of each unknown that lies among combinations which no datum sees, shape (n,).
        resolution: share of each unknown that the data tell, and not the regularisation toward the rule, shape (n,).
        of: whose derivative it is.
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
        """Whether the data alone determine all unknowns; None where that is not known."""
        return None if self.rank is None else self.rank == self.n_unknowns

    @property
    def loose(self) -> tuple[str, ...]:
        """The unknowns that the data alone do not determine."""
        return tuple(name for name, share in zip(self.names, self.undetermined, strict=True) if share > _LOOSE)

    @property
    def weak(self) -> tuple[str, ...]:
        """The unknowns that the regularisation tells more of than the data."""
        return tuple(name for name, share in zip(self.names, self.resolution, strict=True) if share < 0.5)

    @property
    def sentence(self) -> str:
        """What is determined, in a sentence or two."""
        n = self.n_unknowns
        if self.rank is None:
            return f"Whether the data determine the {n} unknowns was not looked at: they are more than {_MOST}."
        if self.rank == n:
            condition = self.singular_values[0] / self.singular_values[-1]
            text = f"The data determine all {n} unknowns (rank {n} of {n}, condition {condition:.1e})."
        else:
            text = (
                f"The data do not determine the unknowns: rank {self.rank} of {n}; {len(self.loose)} unknowns are not "
                f"determined by themselves ({_some(self.loose)}). The regularisation toward the rule chooses among the "
                "rest; more load cases, or fewer unknowns, would tell."
            )
        weak = len(self.weak)
        if weak and self.rank == n:
            few = f"{weak} of them {'is' if weak == 1 else 'are'}"
            text += f" But {few} held by the regularisation more than by the data: {_some(self.weak)}."
        return text


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:_NAMED]) + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")


def identifiability(matrix: Floats, names: Sequence[str], regularisation: float, of: str) -> Identifiability:
    """Return what data whose relative derivative by the unknowns is `matrix`, shape (n_data, n), tell of them.

    The resolution is the diagonal of V s^2 / (s^2 + regularisation^2 / n) V^T (Backus and Gilbert; Menke, Geophysical
    Data Analysis), of the singular values s.
    """
    n = len(names)
    if n > _MOST:
        return Identifiability(tuple(names), None, np.zeros(0), np.zeros(n), np.ones(n), of)
    reduced = np.linalg.qr(matrix, mode="r") if matrix.shape[0] > n else matrix
    values, right = np.linalg.svd(reduced, full_matrices=False)[1:]
    there = values > _ZERO * values.max(initial=0.0)
    seen = right[there] ** 2
    told = values[there] ** 2
    share = told / (told + regularisation**2 / n)
    padded = np.zeros(n)
    padded[: len(values)] = np.where(there, values, 0.0)
    undetermined = np.clip(1 - seen.sum(axis=0), 0.0, 1.0)
    return Identifiability(tuple(names), int(there.sum()), padded, undetermined, share @ seen, of)
