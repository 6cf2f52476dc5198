"""Loops over flat vectors for conjugate gradients."""

from typing import Any

from truespring.kernels.threads import vector_kernel

#: Smallest number of entries that is worth another thread.
SMALLEST = 200_000


@vector_kernel
def advance(first: int, last: int, length: float, p: Any, q: Any, x: Any, r: Any) -> float:
    """Add length p to x, subtract length q from r, and return r . r. Shapes: p, q, x, r (n,)."""
    total = 0.0
    for i in range(first, last):
        x[i] += length * p[i]
        r[i] -= length * q[i]
        total += r[i] * r[i]
    return total


@vector_kernel
def turn_towards(first: int, last: int, z: Any, share: float, p: Any) -> None:
    """Set p to z + share p. Shapes: z, p (n,)."""
    for i in range(first, last):
        p[i] = z[i] + share * p[i]


@vector_kernel
def scalar_product(first: int, last: int, a: Any, b: Any) -> float:
    """Return a . b. Shapes: a, b (n,)."""
    total = 0.0
    for i in range(first, last):
        total += a[i] * b[i]
    return total
