"""Force laws of springs: a law as data, and its loops over the springs of a network."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Floats

#: A function of stiffness k [N/m], rest length L [m], length l [m], arrays of one shape, and dimension d of the body.
OfLength = Callable[[Floats, Floats, Floats, int], Floats]

# Number of springs that are evaluated at once: their arrays stay in the processor's cache.
_AT_ONCE = 8192


@dataclass(frozen=True, slots=True)
class PairLaw:
    """An entry of PAIR_LAWS: the force law of springs that are unstressed at their rest length.

    k is the axial stiffness at the rest length, so the moduli at small strain do not depend on the law.

    Attributes:
        tension: returns the tension [N].
        stiffness: returns the axial stiffness, the derivative of the tension with respect to l [N/m].
        energy: returns the energy [J], zero at the rest length.
        formula: the tension in terms of k, l, L, s = l/L and d.
        linear: whether the tension is linear in l.
        k_body: default of `k_body`, the stiffness of the body diagonals of a cube in E h of the rule `isotropic`.
        compiled: returns compiled loops of the law, with the functions of ArrayLoops; None to evaluate the functions
            above on arrays.
    """

    tension: OfLength
    stiffness: OfLength
    energy: OfLength
    formula: str
    linear: bool
    k_body: float
    compiled: Callable[[], Any] | None = None

    @property
    def loops(self) -> Any:
        """The loops of the law over the springs of a network, see ArrayLoops."""
        return ArrayLoops(self) if self.compiled is None else self.compiled()


class _Slice(NamedTuple):
    """A slice of the springs of a network: stiffness [N/m], rest length and length [m], shape (n,); the dimension."""

    of: slice
    stiffness: Floats
    rest: Floats
    length: Floats
    dim: int

    @property
    def arguments(self) -> tuple[Floats, Floats, Floats, int]:
        """Arguments of the functions of a law."""
        return self.stiffness, self.rest, self.length, self.dim


class ArrayLoops:
    """The loops of `kernels.springs` that depend on the force law, for springs first to last, by functions of arrays.

    Shapes: x, step (n_nodes, dim), springs (n_springs, 2), stiffness, rest and results (n_springs,).
    """

    def __init__(self, law: PairLaw) -> None:
        self.law = law

    def energy(self, first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, zero: Any) -> float:
        """Return the sum of the energies, infinite if the law is infinite at a length of zero."""
        total = 0.0
        for part in _slices(first, last, x, springs, stiffness, rest, zero):
            with np.errstate(divide="ignore"):
                total += float(self.law.energy(*part.arguments).sum())
        return total

    def tensions(
        self, first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, tension: Any, zero: Any
    ) -> None:
        """Write the tension."""
        for part in _slices(first, last, x, springs, stiffness, rest, zero):
            tension[part.of] = self.law.tension(*part.arguments)

    def extrapolated(
        self, first: int, last: int, x: Any, step: Any, springs: Any, stiffness: Any, rest: Any, tension: Any, zero: Any
    ) -> None:
        """Write the tension plus axial stiffness times n . change of d, its linear change along a step."""
        for part in _slices(first, last, x, springs, stiffness, rest, zero):
            a, b = springs[part.of].T
            stretched = ((x[b] - x[a]) * (step[b] - step[a])).sum(axis=1) / part.length
            tension[part.of] = self.law.tension(*part.arguments) + self.law.stiffness(*part.arguments) * stretched

    def pulls(
        self, first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, pull: Any, zero: Any
    ) -> None:
        """Write tension over length."""
        for part in _slices(first, last, x, springs, stiffness, rest, zero):
            pull[part.of] = self.law.tension(*part.arguments) / part.length

    def axial(
        self, first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, found: Any, zero: Any
    ) -> None:
        """Write the axial stiffness."""
        for part in _slices(first, last, x, springs, stiffness, rest, zero):
            found[part.of] = self.law.stiffness(*part.arguments)


def _slices(first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, zero: Any) -> Iterator[_Slice]:
    """Yield springs first to last in slices, with their lengths."""
    from truespring.kernels.springs import lengths

    for begin in range(first, last, _AT_ONCE):
        of = slice(begin, min(begin + _AT_ONCE, last))
        length = np.empty(of.stop - begin)
        lengths(0, len(length), x, springs[of], length, zero)
        yield _Slice(of, stiffness[of], rest[of], length, len(zero))
