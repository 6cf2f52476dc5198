"""Base class of solvers."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from inspect import isclass, signature
from typing import Any, NamedTuple

from scipy import sparse

from truespring.arrays import Floats, Ints
from truespring.completing import completed
from truespring.conditions import Loading
from truespring.errors import ProblemError
from truespring.potential import Potential
from truespring.solvers.balance import Equilibrium, Reporter

# The arguments of `follow`, in order.
_FOLLOW = "potential, loading, report, geometry"


def _admits_all(positions: Floats) -> bool:
    """Admit any positions."""
    return True


def _selects_none(on: Any) -> Ints:
    """Raise ProblemError: without a mesh there is nothing to select on."""
    raise ProblemError(f"on = {on!r}: a potential without a mesh has no selections")


def _no_coarse() -> "Coarse | None":
    """Return None: there is no coarser mesh."""
    return None


@dataclass(frozen=True, slots=True)
class Geometry:
    """Functions of the mesh that a solver may use.

    Attributes:
        admissible: returns whether positions [m], shape (n_nodes, dim), leave all elements uninverted.
        select: returns the node numbers of a selection, shape (n,); selections are those of supports and loads.
        interpolations: returns weights of the nodes from those of coarser meshes, see `linear.choice.choose`; empty if
            there are none.
        coarse_body: returns the same body on a mesh of cells twice as large, None if there is none.
    """

    admissible: Callable[[Floats], bool] = _admits_all
    select: Callable[[Any], Ints] = _selects_none
    interpolations: Callable[[], Sequence[Any]] = tuple
    coarse_body: Callable[[], "Coarse | None"] = _no_coarse


class Coarse(NamedTuple):
    """A body on a coarser mesh.

    Attributes:
        potential, loading, geometry: those of the coarser mesh.
        weights: displacement of the finer nodes from that of the coarser ones, sparse, shape (n_nodes, n_coarse).
    """

    potential: Potential
    loading: Loading
    geometry: Geometry
    weights: "sparse.csr_array[Any]"


class Solver:
    """A method to compute equilibria. Subclasses define `follow`; everything else has a default.

    A user-defined class need not derive from it: `solve` accepts any object with a method `follow`, see `as_solver`.

    Attributes:
        follows_load: whether the load is applied in steps, with equilibria at all levels k / load_steps.
        keeps_to_stable_states: whether an unstable equilibrium is a failure.
        load_steps: number of levels.
        linear: linear solver, see Newton; used where equilibria are analysed further.
    """

    __slots__ = ()

    follows_load: bool = True
    keeps_to_stable_states: bool = True
    load_steps: int = 1
    linear: str = "auto"

    def follow(
        self, potential: Potential, loading: Loading, report: Reporter | None = None, geometry: Geometry | None = None
    ) -> Iterator[Equilibrium]:
        """Yield the equilibria in the order of the path, that without load first.

        If a state cannot be reached, the last one yielded is that of least residual there, with `converged` false.

        Args:
            potential: elastic energy.
            loading: loads and prescribed motion.
            report: called after each iteration with load factor, iteration and relative residual.
            geometry: functions of the mesh; None if the potential has no mesh.
        """
        raise NotImplementedError(f"{type(self).__name__} has no method follow(potential, loading, report, geometry)")

    def check(self, loading: Loading, geometry: Geometry) -> None:
        """Raise ProblemError if the solver does not fit the loading or the mesh; solve nothing."""

    def starting_at(self, start: Callable[[Potential], Floats], max_iterations: int) -> "Solver | None":
        """Return a solver for full load only that starts at given positions, None if the solver has no such variant.

        `start` returns the positions of the nodes of a potential [m], shape (n_nodes, dim).
        """
        return None


def as_solver(given: Any) -> Solver:
    """Return a solver, or any object with a method `follow`, as a Solver.

    Raises ProblemError for other objects, and if `follow` does not take the four arguments of `Solver.follow`.
    """
    if not callable(getattr(given, "follow", None)):
        raise ProblemError(
            f"{given!r} is not a solver; allowed: Newton(), DisplacementControl(...), ArcLength(...) or an object with "
            f"a method follow({_FOLLOW})"
        )
    if isclass(given):
        raise ProblemError(f"{given.__name__} is a class, not a solver: pass an object, such as {given.__name__}(...)")
    if not isinstance(given, Solver):
        _check_follow(given)
    return completed(given, Solver)


def _check_follow(given: Any) -> None:
    """Raise ProblemError if `given.follow` does not take the arguments of `Solver.follow`, by position."""
    try:
        arguments = signature(given.follow)
    except ValueError:  # a compiled function may have none
        return
    expected = _FOLLOW.split(", ")
    misplaced = [
        name for name, right in zip(arguments.parameters, expected, strict=False) if name in {*expected} - {right}
    ]
    try:
        arguments.bind(*expected)
        reason = f"'{misplaced[0]}' is at another place" if misplaced else ""
    except TypeError as error:
        reason = str(error)
    if reason:
        raise ProblemError(
            f"{type(given).__name__} has follow{arguments}: {reason}; define follow(self, {_FOLLOW}), which is called "
            "with four positional arguments"
        )
