"""Preconditioned conjugate gradients, and the lowest eigenvalue by the Lanczos method."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats

Product = Callable[[Floats, Floats], float]
Preconditioner = Callable[[Floats], Floats]
#: Sums a number over processes that have rows of the vectors each.
Total = Callable[[float], float]

# The lowest Ritz value is accepted if its error bound is below this share of it.
_SETTLED = 0.3
# A random start contains little of each eigenvector: the smallest factor by which the iterations must have enlarged the
# share of a negative one, over the square root of the number of unknowns, or else the number of iterations.
_ENLARGED, _FEWEST = 10.0, 10
# Largest number of iterations.
_MOST = 60


class IndefiniteError(ArithmeticError):
    """The matrix is not positive definite: a direction of negative curvature was found."""


class SlowError(ArithmeticError):
    """The iterations did not reach the accuracy; `best` is the last iterate."""

    def __init__(self, best: Floats) -> None:
        super().__init__("conjugate gradients did not reach the accuracy")
        self.best = best


class Solved(NamedTuple):
    """Solution of a linear system, and the number of iterations."""

    solution: Floats
    iterations: int


def norm(x: Floats) -> float:
    """Return the Euclidean norm of an array of shape (n, k)."""
    return float(np.sqrt(scalar_product(x, x)))


def scalar_product(a: Floats, b: Floats) -> float:
    """Return the scalar product of two arrays of the same shape."""
    from truespring.kernels import vectors
    from truespring.kernels.threads import run

    return float(sum(run(vectors.scalar_product, a.size, a.ravel(), b.ravel(), smallest=vectors.SMALLEST)))


def _turn_towards(z: Floats, share: float, p: Floats) -> None:
    """Set p to z + share p."""
    from truespring.kernels import vectors
    from truespring.kernels.threads import run

    run(vectors.turn_towards, p.size, z.ravel(), share, p.ravel(), smallest=vectors.SMALLEST)


def _advance(length: float, p: Floats, q: Floats, x: Floats, r: Floats) -> float:
    """Add length p to x, subtract length q from r, and return r . r."""
    from truespring.kernels import vectors
    from truespring.kernels.threads import run

    flat = (p.ravel(), q.ravel(), x.ravel(), r.ravel())
    return float(sum(run(vectors.advance, x.size, length, *flat, smallest=vectors.SMALLEST)))


def conjugate_gradients(
    product: Product,
    precondition: Preconditioner,
    right: Floats,
    accuracy: float,
    max_iterations: int,
    total: Total = float,
) -> Solved:
    """Return x of A x = right, shape (n, k), with a relative residual of at most `accuracy`.

    Args:
        product: `product(x, result)` writes A x to `result` and returns x . A x.
        precondition: returns an approximate solution for a residual, valid until the next call.
        right: right side, shape (n, k).
        accuracy: relative residual of the solution.
        max_iterations: largest number of iterations.
        total: sum over processes, if each has rows of the vectors.

    Raises IndefiniteError if A has negative curvature along a direction, SlowError if the iterations do not reach the
    accuracy or the preconditioner is not positive definite.
    """
    x, r = np.zeros(right.shape), right.copy()
    target = accuracy * np.sqrt(total(scalar_product(right, right)))
    p, q = np.zeros(right.shape), np.empty(right.shape)
    previous = np.inf
    for iteration in range(1, max_iterations + 1):
        z = precondition(r)
        slope = total(scalar_product(r, z))
        if not slope > 0:  # the preconditioner is not positive definite, because of this matrix or of an earlier one
            if product(z, q) < 0:
                raise IndefiniteError("the matrix is not positive")
            raise SlowError(x)
        _turn_towards(z, slope / previous, p)
        curvature = product(p, q)
        if not curvature > 0:
            raise IndefiniteError("the matrix is not positive")
        size = np.sqrt(total(_advance(slope / curvature, p, q, x, r)))
        if size <= target:
            return Solved(x, iteration)
        previous = slope
    raise SlowError(x)


class Lowest(NamedTuple):
    """The lowest eigenvalue of M^-1 A, which has the sign of that of A; None if it did not converge."""

    eigenvalue: float | None
    iterations: int


def lowest_eigenvalue(product: Product, precondition: Preconditioner, start: Floats, total: Total = float) -> Lowest:
    """Return an estimate of the lowest eigenvalue of the preconditioned matrix, from `start`, shape (n, k).

    `total` sums over processes, if each has rows of the vectors.

    The coefficients of conjugate gradients form the tridiagonal matrix of Lanczos (Golub and Van Loan, 10.3 and 11.5).
    A direction of negative curvature ends the iteration: a negative number is returned.
    """
    from scipy.linalg import eigh_tridiagonal

    r, x = start.copy(), np.zeros(start.shape)
    p, q = np.zeros(start.shape), np.empty(start.shape)
    previous, length = np.inf, 1.0
    enough = _ENLARGED * np.sqrt(total(start.size))
    diagonal: list[float] = []
    beside: list[float] = []
    for iteration in range(1, _MOST + 1):
        z = precondition(r)
        slope = total(scalar_product(r, z))
        if not slope > 0:  # the preconditioner is not positive definite, because of this matrix or of an earlier one
            curvature = product(z, q)
            return Lowest(curvature if curvature < 0 else None, iteration)
        share = slope / previous
        if diagonal:
            beside.append(np.sqrt(share) / length)
            values, vectors = eigh_tridiagonal(np.array(diagonal), np.array(beside[:-1]))
            long_enough = iteration > _FEWEST or _enlarged(values.astype(np.float64)) > enough
            settled = long_enough and beside[-1] * abs(vectors[-1, 0]) <= _SETTLED * values[0]
            if total(float(settled)):  # one process decides for all
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


def _enlarged(values: Floats) -> float:
    """Return how much more than a positive eigenvector the iterations enlarge one whose eigenvalue is not positive.

    `values` are the Ritz values of k iterations, ascending, shape (k,). A polynomial of degree k - 1 that is at most 1
    between the outermost ones reaches T(x) at zero, with Chebyshev's polynomial T (Golub and Van Loan, 10.1.5).
    """
    low, high = float(values[0]), float(values[-1])
    if not 0 < low < high:
        return 0.0
    return float(np.cosh((len(values) - 1) * np.arccosh((high + low) / (high - low))))
