"""Methods and costs of a solution."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Cost:
    """Methods and costs of a solver over all load levels.

    Attributes:
        newton: variant of Newton's method, in words.
        linear: linear solver, in words.
        newton_iterations: number of all Newton iterations, including failed attempts.
        cg_iterations: number of conjugate gradient iterations, 0 for a direct solver.
        lanczos_iterations: number of iterations for the lowest eigenvalue (stability), 0 for a direct solver.
        factorisations: number of factorisations of tangents, or of times that coarse levels were built.
        memory: largest memory of factors or coarse levels [bytes].
        threads: number of threads of compiled loops.
        notes: changes of method, and their reasons.
        coarse: costs on the coarser meshes that the iterations started from, the coarsest first; not included in the
            other values.
    """

    newton: str
    linear: str
    newton_iterations: int = 0
    cg_iterations: int = 0
    lanczos_iterations: int = 0
    factorisations: int = 0
    memory: int = 0
    threads: int = 1
    notes: tuple[str, ...] = ()
    coarse: "tuple[Cost, ...]" = ()
