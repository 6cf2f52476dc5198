"""Preconditioned conjugate gradients, and the lowest eigenvalue by the same recurrence."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh_tridiagonal

from truespring.arrays import Floats

Product = Callable[[Floats, Floats], float]
Preconditioner = Callable[[Floats], Floats]

# The lowest Ritz value is taken for an eigenvalue where its error bound is within this share of it.
_SETTLED = 0.3
# A random start knows of every eigenvector, but of each so little that it takes some iterations to show.
_FEWEST, _MOST = 10, 60


class IndefiniteError(ArithmeticError):
    """A direction was met along which the matrix is not positive."""


class SlowError(ArithmeticError):
    """The iterations allowed were not enough; `best` is what was reached."""

    def __init__(self, best: Floats) -> None:
        super().__init__("conjugate gradients did not reach the accuracy")
        self.best = best


class Solved(NamedTuple):
    """What conjugate gradients found, and the iterations that took."""

    solution: Floats
    iterations: int


def norm(x: Floats) -> float:
    """Return the Euclidean norm of an array of shape (n, k)."""
    return float(np.sqrt(scalar_product(x, x)))


def scalar_product(a: Floats, b: Floats) -> float:
    """Return a . b, arrays of one shape."""
    from truespring.kernels import vectors
    from truespring.kernels.threads import run

    return float(sum(run(vectors.scalar_product, a.size, a.ravel(), b.ravel(), smallest=vectors.SMALLEST)))


def _turn_towards(z: Floats, share: float, p: Floats) -> None:
    from truespring.kernels import vectors
    from truespring.kernels.threads import run

    run(vectors.turn_towards, p.size, z.ravel(), share, p.ravel(), smallest=vectors.SMALLEST)


def _advance(length: float, p: Floats, q: Floats, x: Floats, r: Floats) -> float:
    from truespring.kernels import vectors
    from truespring.kernels.threads import run

    flat = (p.ravel(), q.ravel(), x.ravel(), r.ravel())
    return float(np.sqrt(sum(run(vectors.advance, x.size, length, *flat, smallest=vectors.SMALLEST))))


def conjugate_gradients(
    product: Product, precondition: Preconditioner, right: Floats, accuracy: float, max_iterations: int
) -> Solved:
    """Solve A x = right until the residual is `accuracy` of `right` in size, shapes (n, k).

    `product(x, result)` writes A x and returns x . A x; `precondition(r)` returns an approximate solution,
    good until it is called again.
    Raises IndefiniteError where the matrix is not positive along a direction that was met, SlowError where the
    iterations do not suffice or the preconditioner is not positive.
    """
    x, r = np.zeros(right.shape), right.copy()
    wanted = accuracy * norm(right)
    p, q = np.zeros(right.shape), np.empty(right.shape)
    previous = np.inf
    for iteration in range(1, max_iterations + 1):
        z = precondition(r)
        slope = scalar_product(r, z)
        if not slope > 0:
            raise SlowError(x)  # the preconditioner is that of another state, which was not positive
        _turn_towards(z, slope / previous, p)
        curvature = product(p, q)
        if not curvature > 0:
            raise IndefiniteError("the matrix is not positive")
        size = _advance(slope / curvature, p, q, x, r)
        if size <= wanted:
            return Solved(x, iteration)
        previous = slope
    raise SlowError(x)


class Lowest(NamedTuple):
    """The lowest eigenvalue of M^-1 A: its sign is that of A's own (Sylvester); None where it did not settle."""

    eigenvalue: float | None
    iterations: int


def lowest_eigenvalue(product: Product, precondition: Preconditioner, start: Floats) -> Lowest:
    """Estimate the lowest eigenvalue of the preconditioned matrix from `start`, shape (n, k), by Lanczos.

    The recurrence is that of conjugate gradients, whose coefficients are the tridiagonal matrix (Golub and
    Van Loan, 10.3 and 11.5); where a direction of negative curvature is met, that is the answer.
    """
    r, x = start.copy(), np.zeros(start.shape)
    p, q = np.zeros(start.shape), np.empty(start.shape)
    previous, length = np.inf, 1.0
    diagonal: list[float] = []
    beside: list[float] = []
    for iteration in range(1, _MOST + 1):
        z = precondition(r)
        slope = scalar_product(r, z)
        if not slope > 0:
            return Lowest(None, iteration)
        share = slope / previous
        if diagonal:
            beside.append(np.sqrt(share) / length)
            values, vectors = eigh_tridiagonal(np.array(diagonal), np.array(beside[:-1]))
            if iteration > _FEWEST and beside[-1] * abs(vectors[-1, 0]) <= _SETTLED * values[0]:
                return Lowest(float(values[0]), iteration)
        _turn_towards(z, share, p)
        curvature = product(p, q)
        if not curvature > 0:
            return Lowest(curvature / slope, iteration)
        diagonal.append(curvature / slope + (share / length if beside else 0.0))
        length = slope / curvature
        _advance(length, p, q, x, r)
        previous = slope
    return Lowest(None, _MOST)
