"""The volumes of elements and their derivatives, each kind by the fastest form."""

import sys
from collections import defaultdict
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations, permutations
from math import factorial
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints, ShortInts
from truespring.problem import Problem

# Smallest number of elements for which threads share the work.
_SMALLEST_PIECE = 256
# sys.getrefcount of an array that only a tuple refers to: the tuple's reference and that of the call.
_UNREFERENCED = 2


class Turns(NamedTuple):
    """The terms of the second derivatives of an element's volume, see `kernels.measures.turn`."""

    starts: ShortInts
    others: ShortInts
    coefficients: Floats


class Measured(NamedTuple):
    """Elements at given positions.

    Attributes:
        positions: [m], shape (n_nodes, dim).
        slope: derivatives of the volume by the nodes [m^2], shape (n_elements * n, k, dim): of each element the last
            row; the others are for its quadratic forms.
        volume: signed volume [m^3], area times thickness in 2D, shape (n_elements,).
    """

    positions: Floats
    slope: Floats
    volume: Floats


@dataclass(eq=False)
class ElementVolumes:
    """Volumes of the elements of one kind, and their derivatives.

    Attributes:
        problem: mesh and section.
        elements: node numbers, shape (n_elements, k).
        rows: rows of slopes for each element, the last is that of the volume.
    """

    problem: Problem
    elements: ShortInts
    rows: int

    @cached_property
    def form(self) -> tuple[Ints, float]:
        """The simplices of an element, and the factor of the sum of their determinants [-] or [m]."""
        section, kind = self.problem.section, self.problem.mesh.kind
        assert section is not None  # see require_body
        return np.array(kind.simplices), section.thickness * kind.simplex_weight / factorial(kind.dim)

    @cached_property
    def turns(self) -> Turns:
        """The terms of the second derivatives of an element's volume."""
        turns = _unit_turns(self.problem.mesh.kind.simplices, self.elements.shape[1])
        return turns._replace(coefficients=self.form[1] * turns.coefficients)

    @cached_property
    def _road(self) -> tuple[Any, tuple[Any, ...]]:
        """The kernel of the kind of elements, and its arguments."""
        from truespring.kernels import measures

        section, kind = self.problem.section, self.problem.mesh.element
        assert section is not None  # see require_body
        known = {
            "hexahedron": (measures.hexahedra, (measures.LANES,)),
            "quadrilateral": (measures.quadrilaterals, (section.thickness,)),
        }
        return known.get(kind, (measures.of_simplices, (*self.form, (0.0,) * self.problem.mesh.dim)))

    def at(self, positions: Floats) -> tuple[Floats, Floats]:
        """Return slopes and volumes at positions [m], see Measured; those of the last positions are kept."""
        last: Measured | None = self.__dict__.pop("_last", None)
        if last is None or not np.array_equal(last.positions, positions):
            last = Measured(positions.copy(), *self._fill(positions, last))
        found = last.slope, last.volume  # before another thread can take `last` for its positions
        self.__dict__["_last"] = last
        return found

    def _fill(self, positions: Floats, last: Measured | None) -> tuple[Floats, Floats]:
        """Return slopes and volumes, in the arrays of the last positions unless something else refers to them."""
        from truespring.kernels.threads import run, writable

        n, k = self.elements.shape
        if last is None or max(sys.getrefcount(last.slope), sys.getrefcount(last.volume)) > _UNREFERENCED:
            slope, volume = np.empty((n * self.rows, k, self.problem.mesh.dim)), np.empty(n)
        else:
            slope, volume = last.slope, last.volume
        kernel, form = self._road
        known = (writable(positions), self.elements, *form, self.rows)
        run(kernel, n, *known, slope, volume, smallest=_SMALLEST_PIECE)
        return slope, volume


@cache
def _unit_turns(simplices: tuple[tuple[int, ...], ...], k: int) -> Turns:
    """Return the terms of an element of `k` nodes, whose volume is the sum of the determinants of its simplices."""
    found = defaultdict[tuple[int, int, int], float](float)
    for simplex in simplices:
        for left_out, three in enumerate(combinations(simplex, 3)):
            # det of the edges from the first of four = the sum of det of the faces' corners, signs alternating
            sign = 1.0 if len(simplex) == 3 or left_out in (1, 3) else -1.0
            for order in permutations(range(3)):
                a, b, c = (int(three[i]) for i in order)
                even = (order[1] - order[0]) % 3 == 1
                if len(simplex) == 4:
                    found[a, b, c] += sign * (1.0 if even else -1.0)
                else:
                    found[a, b, 0] += 1.0 if even else -1.0
    terms = sorted(key for key, value in found.items() if value)
    pairs = [a * k + b for a, b, _ in terms]
    starts = np.searchsorted(pairs, np.arange(k * k + 1)).astype(np.int32)
    return Turns(starts, np.array([c for *_, c in terms], np.int32), np.array([found[key] for key in terms]))
