"""Newton's method from a state that is nearly an equilibrium at full load: of the same body on a coarser mesh."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from truespring.arrays import Floats
from truespring.linear.choice import choose
from truespring.potential import Loading, Potential, Stressed
from truespring.solvers import mixed
from truespring.solvers.balance import Balance, Equilibrium, Reporter
from truespring.solvers.line_search import descend
from truespring.solvers.newton import Newton


@dataclass(frozen=True, slots=True, eq=False)
class Nearby(Newton):
    """Newton's method at full load alone, from the positions that `start` gives for the nodes of the potential [m].

    The path has this one state, on the same branch as the start. `start` is asked for shape (n_nodes, dim); where
    motion is prescribed it is made exact here.
    """

    start: Callable[[Potential], Floats] | None = None

    def follow(
        self,
        potential: Potential,
        loading: Loading,
        report: Reporter | None = None,
        admissible: Callable[[Floats], bool] = lambda positions: True,
    ) -> Iterator[Equilibrium]:
        """Yield the state at full load; not converged where it was not found from there."""
        balance = Balance(
            potential,
            loading,
            self.tolerance,
            self.max_iterations,
            choose(self.linear, potential.nodes, loading.held),
            report,
        )
        positions = potential.nodes.copy() if self.start is None else self.start(potential)
        positions[loading.held] = (potential.nodes + loading.motion())[loading.held]
        found = None
        if isinstance(potential, Stressed):
            found = mixed.converge(balance, 1.0, mixed.Start(positions, potential.stress(positions)))
        if found is None or not found.state.converged or not admissible(found.state.positions):
            found = descend(balance, 1.0, positions)
        yield self._with_cost(found.state, balance)
