"""Linear solvers behind one interface: a tangent made ready, which solves and tells of its stability.

Directions that are held take no part: right sides and solutions of shape (n_nodes, dim) are zero there.
"""

from types import MappingProxyType
from typing import ClassVar, Protocol

from truespring.arrays import Bools, Floats
from truespring.errors import ProblemError, nearest
from truespring.linear.direct import FACTORISERS, Direct, direct_bytes, present
from truespring.linear.iterative import Multigrid
from truespring.memory import available_memory
from truespring.potential import SparseMatrix

# Up to so many free directions, in the plane and in space, a factorisation is as quick as multigrid, and exact.
_DIRECT = MappingProxyType({2: 8_000, 3: 3_000})


class Tangent(Protocol):
    """A tangent stiffness made ready to be solved with."""

    #: Whether it stays good when the solver is given the next one.
    lasting: ClassVar[bool]

    @property
    def negative_eigenvalues(self) -> int | None:
        """Their number; of an iterative solver 1 where there is any; None where it is not known."""
        ...

    def solve(self, right: Floats, accuracy: float = 1e-12) -> Floats:
        """Return x of tangent x = right, to a relative residual of `accuracy` or better.

        Raises IndefiniteError where an iterative solver meets a negative direction.
        """
        ...

    def lowest_mode(self) -> Floats | None:
        """Return a mode of a negative eigenvalue, largest component +1; None where there is no way to it."""
        ...


class LinearSolver(Protocol):
    """What makes tangents ready.

    Attributes:
        name: what is used, in words.
        factorisations, cg_iterations, lanczos_iterations: what was spent so far.
        memory: the most that factors or coarse levels took [bytes].
    """

    name: str
    factorisations: int
    cg_iterations: int
    lanczos_iterations: int
    memory: int

    def ready(self, matrix: SparseMatrix, positions: Floats) -> Tangent:
        """Take a tangent at some positions; raise SingularMatrixError where it has no inverse."""
        ...


#: What `linear` may be of a solver's settings.
LINEAR = ("auto", "direct", "multigrid", *FACTORISERS)


def check_linear(name: str) -> None:
    """Raise ProblemError for a linear solver that does not exist or is not installed."""
    if name not in LINEAR:
        raise ProblemError(f"linear = '{name}' is unknown{nearest(name, LINEAR)}; allowed: {', '.join(LINEAR)}")
    if name in FACTORISERS and not present(name):
        raise ProblemError(f"linear = '{name}': it is not installed; try: pip install {FACTORISERS[name].package}")


def choose(name: str, nodes: Floats, held: Bools) -> LinearSolver:
    """Return the linear solver `name` of LINEAR; "auto" goes by size and dimension.

    Raises ProblemError where a factorisation would not fit in memory, by estimate.
    """
    check_linear(name)
    n_free, dim = int((~held).sum()), nodes.shape[1]
    if name == "auto":
        name = "direct" if dim not in _DIRECT or n_free <= _DIRECT[dim] else "multigrid"
    if name == "multigrid":
        return Multigrid(nodes, held)
    needed, there = direct_bytes(nodes.shape), available_memory()
    if needed > there:
        raise ProblemError(
            f"linear = '{name}': a factorisation for {len(nodes):,} nodes needs about {needed / 2**30:,.0f} GiB, "
            f"{there / 2**30:,.1f} GiB are there: take linear = 'multigrid' or fewer elements"
        )
    return Direct(held, name)
