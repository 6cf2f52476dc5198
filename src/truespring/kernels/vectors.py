"""Loops over vectors, flat, as conjugate gradients need them."""

from typing import Any

from truespring.kernels.threads import vector_kernel

#: Of so few numbers threads are not asked to take a share: handing it over takes longer than the loop.
SMALLEST = 200_000


@vector_kernel
def advance(first: int, last: int, length: float, p: Any, q: Any, x: Any, r: Any) -> float:
    """Step x along p and r against q; the sum of r . r."""
    total = 0.0
    for i in range(first, last):
        x[i] += length * p[i]
        r[i] -= length * q[i]
        total += r[i] * r[i]
    return total


@vector_kernel
def turn_towards(first: int, last: int, z: Any, share: float, p: Any) -> None:
    """p = z + share p."""
    for i in range(first, last):
        p[i] = z[i] + share * p[i]


@vector_kernel
def scalar_product(first: int, last: int, a: Any, b: Any) -> float:
    """The sum of a . b."""
    total = 0.0
    for i in range(first, last):
        total += a[i] * b[i]
    return total
