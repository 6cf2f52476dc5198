"""A solver: how equilibria are found, and what the rest of the code asks of it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from truespring.arrays import Floats, Ints
from truespring.completing import completed
from truespring.conditions import Loading
from truespring.errors import ProblemError
from truespring.potential import Potential
from truespring.solvers.balance import Equilibrium, Reporter


def _admits_all(positions: Floats) -> bool:
    return True


def _selects_none(on: Any) -> Ints:
    raise ProblemError(f"on = {on!r}: a potential alone has no named places")


@dataclass(frozen=True, slots=True)
class Geometry:
    """The body around a potential: what a solver may ask beside energy and forces.

    Attributes:
        admissible: whether positions [m], shape (n_nodes, dim), leave every element upright.
        select: returns the numbers of the nodes at a place of the body, as supports and loads name it, shape (n,).
    """

    admissible: Callable[[Floats], bool] = _admits_all
    select: Callable[[Any], Ints] = _selects_none


class Solver:
    """How equilibria are found. A subclass gives `follow`; the other answers have defaults.

    A class of the user's own need not derive from it: `solve` takes any object with a method `follow`. See `as_solver`.

    Attributes:
        follows_load: whether the load is applied in steps, and each level k / load_steps is among the equilibria.
        keeps_to_stable_states: whether an unstable equilibrium is a failure, not a part of the path.
        load_steps: the number of levels.
        linear: how linear systems are solved at the equilibria, see Newton.
    """

    __slots__ = ()

    follows_load: bool = True
    keeps_to_stable_states: bool = True
    load_steps: int = 1
    linear: str = "auto"

    def follow(
        self, potential: Potential, loading: Loading, report: Reporter | None = None, geometry: Geometry | None = None
    ) -> Iterator[Equilibrium]:
        """Yield the equilibria in path order, first the body without load.

        `report` is called after each iteration. Where a state cannot be reached the last one yielded has
        `converged = False`: the best state there.
        """
        raise NotImplementedError(f"{type(self).__name__} has no method follow(potential, loading, report, geometry)")

    def check(self, loading: Loading, geometry: Geometry) -> None:
        """Raise ProblemError where the solver does not fit the loading or the body; solve nothing."""

    def starting_at(self, start: Callable[[Potential], Floats], max_iterations: int) -> "Solver | None":
        """Return a solver for full load alone that starts at given positions; None where there is none.

        `start` returns the positions for the nodes of a potential [m], shape (n_nodes, dim).
        """
        return None


def as_solver(given: Any) -> Solver:
    """Return a solver, or a user's object with a method `follow`, as a Solver; raise ProblemError for anything else."""
    if not callable(getattr(given, "follow", None)):
        raise ProblemError(
            f"{given!r} is no solver: give Newton(), DisplacementControl(...), ArcLength(...) or an object with a "
            "method follow(potential, loading, report, geometry)"
        )
    return completed(given, Solver)
