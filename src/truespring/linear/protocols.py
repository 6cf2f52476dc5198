"""Protocols of linear solvers.

Held directions are excluded: right sides and solutions, shape (n_nodes, dim), are zero there.
"""

from typing import ClassVar, Protocol

from truespring.arrays import Floats
from truespring.potential import SparseMatrix


class Tangent(Protocol):
    """A tangent stiffness prepared for solving."""

    #: Whether it remains valid when the solver prepares the next tangent.
    lasting: ClassVar[bool]

    @property
    def negative_eigenvalues(self) -> int | None:
        """The number of negative eigenvalues; of an iterative solver 1 if there are any; None if not known."""
        ...

    def solve(self, right: Floats, accuracy: float = 1e-12) -> Floats:
        """Return x of tangent x = right [m], shape (n_nodes, dim), with a relative residual of at most `accuracy`.

        Raises IndefiniteError if an iterative solver finds a direction of negative curvature.
        """
        ...

    def lowest_mode(self) -> Floats | None:
        """Return a mode of a negative eigenvalue, largest component +1 [-], shape (n_nodes, dim).

        None if not available.
        """
        ...


class LinearSolver(Protocol):
    """A method that prepares tangents for solving.

    Costs are those so far, see Cost.
    """

    @property
    def name(self) -> str:
        """Name for notes and reports."""
        ...

    @property
    def factorisations(self) -> int:
        """The number of factorisations, or of times that coarse levels were built."""
        ...

    @property
    def cg_iterations(self) -> int:
        """The number of iterations of conjugate gradients."""
        ...

    @property
    def lanczos_iterations(self) -> int:
        """The number of Lanczos iterations."""
        ...

    @property
    def memory(self) -> int:
        """Largest memory of factors or coarse levels [bytes]."""
        ...

    def ready(self, matrix: SparseMatrix, positions: Floats) -> Tangent:
        """Prepare the tangent at `positions` [m], shape (n_nodes, dim); raise SingularMatrixError without an inverse.

        `matrix` has shape (n_dof, n_dof).
        """
        ...
