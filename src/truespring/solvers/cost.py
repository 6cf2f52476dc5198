"""What a path cost, and by which choices."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Cost:
    """The choices of a solver and what they cost, over all load levels.

    Attributes:
        newton: how balance was found, in words.
        linear: what solved the linear systems, in words.
        newton_iterations: all of them, those of attempts that were given up included.
        cg_iterations: of conjugate gradients; 0 for a direct solver.
        lanczos_iterations: of the search for the lowest eigenvalue, which tells of stability; 0 for a direct solver.
        factorisations: of tangents, or how often coarse levels were built.
        memory: the most that factors or coarse levels took [bytes].
        threads: how many the compiled loops may take.
        notes: where a first choice was given up, and for what.
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
