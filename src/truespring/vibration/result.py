"""The lowest natural frequencies of a body, and its shapes."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.potential import Potential
from truespring.problem import Problem


@dataclass(frozen=True, eq=False, repr=False)
class Modes:
    """Natural frequencies and shapes of small vibrations about the undeformed body, lowest first, by one model.

    They solve K u = omega^2 M u: K is the Hessian of the potential at the undeformed body, in the directions that
    supports leave free; M is the lumped mass. Loads are not applied.

    Attributes:
        problem: the body with its supports.
        label, has_springs: label of the model, and whether it consists of springs.
        potential: its potential.
        eigenvalues: omega^2 [1/s^2], shape (n,); negative if the undeformed body is unstable.
        shapes: displacement of the nodes of the mesh, largest component +1 [-], shape (n, n_nodes, dim).
        modal_mass: u . M u of each shape [kg], shape (n,); a shape over its root is normalised by mass.
        n_rigid: number of rigid-body motions that the supports leave: they have the frequency 0, and are not listed.
        residuals: bound of the relative error of omega^2 as an eigenvalue of the matrices [-], shape (n,): the norm of
            M^-1/2 (K - omega^2 M) u over omega^2.
        converged: whether all of them are accurate.
        n_unknowns, method, seconds: number of free directions, method of solution, and its time [s].
        warnings: sentences.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.16, 0.04), (8, 2)),
        ...     ts.Material(young=10e3, poisson=0.3, density=1000.0),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     stated=False,
        ... )
        >>> found = ts.modes(problem, ts.Fem("linear"), count=2)
        >>> found.n_rigid, found.shapes.shape
        (0, (2, 27, 2))
    """

    problem: Problem
    label: str
    has_springs: bool
    potential: Potential
    eigenvalues: Floats
    shapes: Floats
    modal_mass: Floats
    n_rigid: int
    residuals: Floats
    converged: bool
    n_unknowns: int
    method: str
    seconds: float
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        found = ", ".join(f"{one:.6g}" for one in self.frequencies[:6])
        return f"Modes({self.label}: {found}{' ...' if len(self.frequencies) > 6 else ''} Hz, {self.n_rigid} rigid)"

    @property
    def frequencies(self) -> Floats:
        """Natural frequencies omega / (2 pi) [Hz], ascending, shape (n,); nan where omega^2 is negative."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(self.eigenvalues) / (2 * np.pi))

    @property
    def stable(self) -> bool:
        """Whether no eigenvalue is negative."""
        return bool((self.eigenvalues >= 0).all())
