"""What is asked of a motion: its duration, time step, scheme, damping, start; and what is recorded of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from truespring.arrays import Floats
from truespring.errors import ProblemError, nearest

#: Schemes of time integration: "auto" chooses between "leapfrog" and "bdf2" by the largest stable step.
SCHEMES = ("auto", "euler", "bdf2", "midpoint", "leapfrog")
#: States at which a motion begins.
STARTS = ("rest", "equilibrium")


@dataclass(frozen=True, slots=True)
class Damping:
    """Damping of a body by its material and by its surroundings.

    Attributes:
        stiffness: time of the dashpot beside each spring or element, of its viscosity over its stiffness [s].
        mass: force against the velocity over mass [1/s]; it brakes a free fall, too.

    Example:
        >>> import truespring as ts
        >>> ts.Damping(stiffness=0.002, mass=0.5)
        Damping(stiffness=0.002, mass=0.5)
    """

    stiffness: float = 0.0
    mass: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("stiffness", "s"), ("mass", "1/s")):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and math.isfinite(value) and value >= 0):
                raise ProblemError(f"damping: {name} = {value!r} {unit}: must be a number that is not negative")


@dataclass(frozen=True, slots=True)
class Dynamics:
    """The motion of a body in time.

    Attributes:
        duration: time of the motion [s].
        step: time step [s]; "auto" chooses each step by an estimate of its error.
        scheme: "euler" (order 1, damps), "bdf2" (order 2, damps little), "midpoint" (order 2, keeps energy), "leapfrog"
            (order 2, explicit), "auto" (leapfrog where its stable step is long, else bdf2).
        damping: damping by the material and the surroundings.
        start: "rest" begins at the undeformed body, "equilibrium" at the equilibrium under the loads of time 0.
        velocity: velocity of all nodes at time 0 [m/s], one value per direction; None for zero.
        iterations: 0 solves each step to the tolerance of the solver; n stops after n Newton iterations, as real-time
            programs do.
        record: time between recorded states [s]; None for a hundredth of the duration, at least a step. Steps are
            shortened so that a whole number of them fits in it.
        accuracy: with `step` "auto", the largest error of a step over the largest displacement [-].
        creep: speed at which regularised friction is full [m/s]; None for 0.001 sqrt(g L), L the size of the body.
        substeps: number of parts that each step is divided into, to estimate the error of the step.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3, density=1000.0),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Gravity((0.0, -9.81))],
        ...     dynamics=ts.Dynamics(duration=0.05),
        ... )
        >>> ts.solve(problem, ts.Springs("gaussian")).states[-1].load_factor
        1.0
    """

    duration: float
    step: float | str = "auto"
    scheme: str = "auto"
    damping: Damping = field(default_factory=Damping)
    start: str = "rest"
    velocity: Sequence[float] | None = None
    iterations: int = 0
    record: float | None = None
    accuracy: float = 1e-4
    creep: float | None = None
    substeps: int = 1

    def __post_init__(self) -> None:
        self._check_positive("duration", self.duration)
        if self.step != "auto":
            self._check_positive("step", self.step)
            if isinstance(self.step, int | float) and self.step > self.duration:
                raise ProblemError(f"step = {self.step:g} s is longer than duration = {self.duration:g} s")
        for name in ("record", "creep"):
            if getattr(self, name) is not None:
                self._check_positive(name, getattr(self, name))
        for name, allowed in (("scheme", SCHEMES), ("start", STARTS)):
            value = getattr(self, name)
            if value not in allowed:
                raise ProblemError(f"{name} = {value!r}{nearest(str(value), allowed)}; allowed: {', '.join(allowed)}")
        if not isinstance(self.damping, Damping):
            raise ProblemError(f"damping = {self.damping!r}: must be Damping(stiffness=..., mass=...)")
        if not isinstance(self.substeps, int) or self.substeps < 1:
            raise ProblemError(f"substeps = {self.substeps!r}: must be a whole number of at least 1")
        if isinstance(self.iterations, bool) or not isinstance(self.iterations, int) or self.iterations < 0:
            raise ProblemError(f"iterations = {self.iterations!r}: must be 0, to solve each step, or a number of them")
        if self.iterations and self.step == "auto":
            raise ProblemError('iterations needs a step in seconds: step = "auto" estimates errors of solved steps')
        if not isinstance(self.accuracy, int | float) or not 0 < self.accuracy < 1:
            raise ProblemError(f"accuracy = {self.accuracy!r}: must be between 0 and 1")

    def words(self) -> str:
        """Return duration, scheme, step, damping and begin, for tables."""
        step = "automatic step" if self.step == "auto" else f"step {self.step:g} s"
        parts = [f"{self.duration:g} s by {self.scheme}, {step}"]
        parts += [f"{self.iterations} iteration{'s' * (self.iterations != 1)} a step"] if self.iterations else []
        parts += [f"damping {self.damping.stiffness:g} s by stiffness"] if self.damping.stiffness else []
        parts += [f"damping {self.damping.mass:g} 1/s by mass"] if self.damping.mass else []
        parts += ["from the equilibrium at time 0"] if self.start == "equilibrium" else []
        if self.velocity is not None:
            parts.append(f"velocity ({', '.join(f'{one:g}' for one in self.velocity)}) m/s at the begin")
        return ", ".join(parts)

    def _check_positive(self, name: str, value: object) -> None:
        """Raise ProblemError if a value is not a positive number."""
        if isinstance(value, bool) or not (isinstance(value, int | float) and math.isfinite(value) and value > 0):
            allowed, unit = ', or "auto"' if name == "step" else "", "m/s" if name == "creep" else "s"
            raise ProblemError(f"{name} = {value!r} {unit}: must be a positive number{allowed}")


@dataclass(frozen=True, slots=True)
class Energies:
    """Energies at one time [J].

    Attributes:
        kinetic, elastic: those of the body.
        loads: minus the work of loads, moved supports and moving tools since the begin.
        contact: stored in contacts and grasps.
        damped: dissipated by damping and friction since the begin.
        numerical: dissipated by the scheme since the begin: what is missing in the sum.
    """

    kinetic: float
    elastic: float
    loads: float
    contact: float
    damped: float
    numerical: float

    @property
    def total(self) -> float:
        """The sum of kinetic and elastic energy, loads and contact: constant but for what is dissipated [J]."""
        return self.kinetic + self.elastic + self.loads + self.contact


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """What a state of a motion has beyond a state at rest.

    Attributes:
        time: [s].
        velocity: velocity of the nodes of the potential [m/s], shape (n_nodes, dim).
        energies: energies [J].
    """

    time: float
    velocity: Floats
    energies: Energies
