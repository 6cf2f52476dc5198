"""A step in time, and the protocol of the schemes that take it."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Loading
from truespring.motion.moving import Body
from truespring.motion.record import Account
from truespring.motion.stages import History, Moment
from truespring.solvers.balance import Equilibrium


@dataclass(frozen=True, eq=False)
class Advance:
    """A step that was taken.

    Attributes:
        moment: the state at its end.
        state: the balance of the step, whose internal force includes inertia and damping.
        loading: the loading, with the friction of the step.
        acceleration: [m/s^2], shape (n_nodes, dim).
        account: the work up to the end of the step.
        iterations: Newton iterations, with those of steps that failed before it.
    """

    moment: Moment
    state: Equilibrium
    loading: Loading
    acceleration: Floats
    account: Account
    iterations: int

    @staticmethod
    def none(moment: Moment, loading: Loading, account: Account) -> "Advance":
        """Return the begin of a motion as a step of no length."""
        still = np.zeros_like(moment.positions)
        state = Equilibrium(0.0, moment.positions, still, still, 0.0, 0, 0.0, converged=True)
        return Advance(moment, state, loading, still, account, 0)


class Scheme(Protocol):
    """A way to take steps.

    Attributes:
        body: what moves; another loading may take the place of its own between steps.
    """

    body: Body

    def forget(self) -> None:
        """Forget what is kept of the last step: the next one begins at another state."""
        ...

    def ready(self, moment: Moment) -> None:
        """Compute what a step from a state begins with, under the present loading, unless the last step left it."""
        ...

    def advance(self, history: History, h: float, account: Account) -> Advance | Equilibrium:
        """Return a step of length h [s] with the work in it; the state of least residual if it was not found."""
        ...
