"""Models whose solution comes from elsewhere: from another program, or from a file."""

from dataclasses import dataclass

from truespring.models import Model
from truespring.problem import Problem
from truespring.solution import Solution
from truespring.solvers import Reporter, Solver


class Program(Model):
    """A model that another program solves: a subclass gives `kind`, `label_on` and `run`, and has no potential."""

    any_mesh = False

    def check_run(self, problem: Problem, solver: Solver) -> None:
        """Raise TruespringError where the program cannot be run on the problem; solve nothing."""

    def run(
        self, problem: Problem, solver: Solver, report: Reporter | None = None, timeout: float | None = None
    ) -> Solution:
        """Return the equilibria at the load levels of the solver; the program has `timeout` seconds at most."""
        raise NotImplementedError(f"{type(self).__name__} has no method run(problem, solver, report, timeout)")


@dataclass(frozen=True, eq=False)
class ReadSolution(Program):
    """A solution that was read from a file, in the place of a model.

    Attributes:
        solution: what the file holds.
    """

    solution: Solution

    solves = False

    @property
    def kind(self) -> str:  # type: ignore[override]
        """The kind of the solution, its file's format."""
        return self.solution.kind

    @property
    def label(self) -> str:
        """The label of the solution."""
        return self.solution.label

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return the warnings of the solution."""
        return self.solution.warnings

    def run(
        self, problem: Problem, solver: Solver, report: Reporter | None = None, timeout: float | None = None
    ) -> Solution:
        """Return the solution."""
        return self.solution
