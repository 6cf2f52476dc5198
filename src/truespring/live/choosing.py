"""The choice of a scheme for a live body: by its stable step, and by the time that steps take on this machine."""

import time
from dataclasses import dataclass

import numpy as np

from truespring.errors import LiveError
from truespring.live.actions import Weight
from truespring.live.compiled import Compiled, fitting
from truespring.live.steppers import Acting, StepByStep, Stepper
from truespring.motion.explicit import SAFE, Leapfrog
from truespring.motion.follow import balance_of
from truespring.motion.implicit import Implicit
from truespring.motion.moving import Body
from truespring.motion.stages import Moment
from truespring.solvers import Geometry, Newton

# Steps of an implicit scheme in a frame, unless a step is asked for.
_IMPLICIT_STEPS = 4
# Largest number of steps of leapfrog in a frame.
_MOST = 1000
# Number of times that steps are timed, of which the shortest counts, and steps of leapfrog each time.
_TIMES, _STEPS = 3, 2


@dataclass(frozen=True, eq=False)
class Choice:
    """How steps are taken.

    Attributes:
        scheme: a scheme of `Dynamics`.
        stepper: takes the steps.
        longest: longest step [s].
        why: the reason in a sentence, without a full stop; "" if it was asked for.
        slow: whether a frame was measured to take longer than the time between frames.
    """

    scheme: str
    stepper: Stepper
    longest: float
    why: str = ""
    slow: bool = False


@dataclass(frozen=True, eq=False)
class Schemes:
    """The schemes for a body.

    Attributes:
        body: the body.
        geometry: functions of its mesh.
        stable: the largest stable step of leapfrog at rest [s], 0 if there is none.
        frame: time between frames [s].
        step: longest step that is asked for [s], None for that of the scheme.
        iterations: Newton iterations of an implicit step, 0 to solve it.
    """

    body: Body
    geometry: Geometry
    stable: float
    frame: float
    step: float | None
    iterations: int

    def chosen(self, scheme: str) -> Choice:
        """Return how steps of a scheme are taken, of the best one for "auto"."""
        if scheme == "auto":
            return self._best()
        return self._leapfrog() if scheme == "leapfrog" else self._implicit(scheme)

    def _leapfrog(self) -> Choice:
        if not self.stable:
            raise LiveError('leapfrog has no stable step with a barrier: use bdf2, or contact = "penalty"')
        safe = SAFE * self.stable
        longest = safe if self.step is None else min(safe, self.step)
        springs = fitting(self.body)
        plain = StepByStep(Leapfrog(self.body), "leapfrog")
        return Choice("leapfrog", plain if springs is None else Compiled(self.body, springs), longest)

    def _implicit(self, scheme: str) -> Choice:
        longest = self.frame / _IMPLICIT_STEPS if self.step is None else self.step
        balance = balance_of(self.body, Newton(), None, self.geometry)
        return Choice(scheme, StepByStep(Implicit(self.body, balance, scheme, self.iterations), scheme), longest)

    def _best(self) -> Choice:
        """Return leapfrog, unless it has no stable step, or needs more than _MOST steps a frame.

        Its error is the smaller one: in the undamped cube of docs/motion.md bdf2 with four steps a frame of 1/60 s is
        17 % off, leapfrog 0.26 %, in a fifth of the time.
        """
        first = self._leapfrog() if self.stable else None
        if first is None or self._count(first) > _MOST:
            found = self._implicit("bdf2")
            why = "has no stable step" if first is None else f"needs {self._count(first)} steps a frame"
            return Choice("bdf2", found.stepper, found.longest, f"bdf2: leapfrog {why}")
        spent = self._time_of(first, _STEPS)
        why = f"{self._words(first)} take {_ms(spent)} of {_ms(self.frame)} on this machine"
        if spent <= self.frame:
            return Choice("leapfrog", first.stepper, first.longest, why)
        return Choice(
            "leapfrog", first.stepper, first.longest, f"{why}: real-time factor {self.frame / spent:.2g}", slow=True
        )

    def _words(self, choice: Choice) -> str:
        n = self._count(choice)
        return f"{choice.scheme}: {n} steps of {_ms(self.frame / n)} a frame"

    def _count(self, choice: Choice) -> int:
        return max(1, int(np.ceil(self.frame / choice.longest)))

    def _time_of(self, choice: Choice, steps: int) -> float:
        """Return the time in which a frame is computed [s], from a number of steps at rest."""
        nodes, stepper = self.body.potential.nodes, choice.stepper
        n = min(steps, self._count(choice))
        rest = Moment(0.0, nodes.copy(), np.zeros(nodes.shape))
        nothing = Acting((), (), (np.zeros(0, dtype=np.int64), np.zeros(0)), Weight(np.zeros(nodes.shape), 0.0, 0.0))
        h = self.frame / self._count(choice)
        last = stepper.frame(rest, nothing, n, h).moment  # compiles, and sets up solvers
        shortest = np.inf
        for _ in range(_TIMES):
            stepper.forget()  # all begin at the same state
            started = time.perf_counter()
            last = stepper.frame(last, nothing, n, h).moment
            shortest = min(shortest, time.perf_counter() - started)
        stepper.forget()
        return float(shortest / n * self._count(choice))


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms"
