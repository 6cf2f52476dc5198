"""Models that another program solves, and solutions that are read from a file."""

from dataclasses import dataclass

from truespring.models import Model
from truespring.problem import Problem
from truespring.solution import Solution
from truespring.solvers import Reporter, Solver


class Program(Model):
    """A model without a potential that another program solves; a subclass defines `kind`, `label_on` and `run`."""

    any_mesh = False

    def check_run(self, problem: Problem, solver: Solver) -> None:
        """Raise TruespringError if the program cannot solve the problem; solve nothing."""

    def run(
        self, problem: Problem, solver: Solver, report: Reporter | None = None, timeout: float | None = None
    ) -> Solution:
        """Run the program for at most `timeout` seconds; return the equilibria at the load levels of the solver."""
        raise NotImplementedError(f"{type(self).__name__} has no method run(problem, solver, report, timeout)")


@dataclass(frozen=True, eq=False)
class ReadSolution(Program):
    """A solution from a file, used as a model of a study.

    Attributes:
        solution: the solution.
    """

    solution: Solution

    solves = False

    @property
    def kind(self) -> str:  # type: ignore[override]
        """The kind of the solution, the format of its file."""
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
