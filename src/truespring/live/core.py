"""The state of a session: what commands change and frames advance."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from truespring.dynamics import Dynamics
from truespring.live.choosing import Choice, Schemes
from truespring.live.commands import Log
from truespring.live.completed import completed
from truespring.live.cut import Aside, Built, Whole, built
from truespring.live.gravity import FullGravity, weighted
from truespring.live.held import Held
from truespring.live.mover import Mover
from truespring.live.settings import Begun, Settings
from truespring.live.sizes import Sizes
from truespring.live.state import State
from truespring.live.steppers import Acting
from truespring.material import Material
from truespring.models import Model, as_model
from truespring.motion.follow import begin_of
from truespring.motion.stages import Moment
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.solvers import Newton


class Core:
    """A session without its calls.

    Attributes:
        settings: how steps are taken.
        notes: what was assumed, and what happened, in sentences.
        problem: the completed problem, with changed material and damping.
        model: the model.
        whole, left: the body as stated, and what cuts left of it.
        aside: the cut that is built in another thread.
        changes: what was asked of the material, by kind of command.
        decided: the scheme of "auto"; None until it is chosen.
        why: why it was chosen.
        gravity, share: gravity, and what it is multiplied by [-].
        log: the commands since the begin.
        held: grasps and spheres.
        built: what moves.
        sizes: its sizes.
        weight: gravity beyond that of the loads.
        body: what moves, with the weight.
        mover: takes the frames.
        moment: the state, with the further nodes of second-order elements.
        work: work of all that acts, and energy dissipated by damping, in the last frame [J].
        begun: what the session begins with.
    """

    def __init__(
        self, problem: Problem, model: Model | Potential, models: Mapping[str, Model], settings: Settings
    ) -> None:
        """Bring the body to its begin; arguments and errors as `Live`."""
        self.settings, self.notes = settings, list[str]()
        self.model = as_model(model)
        self.problem, notes = completed(problem)
        self.notes.extend(notes)
        self.whole = self.left = Whole.of(self.problem, self.model, dict(models))
        self.aside = Aside()
        self.changes: dict[str, float] = {}
        self.decided: str | None = None
        self.why = ""
        self.gravity = FullGravity.of(self.problem)
        self.share = self.gravity.usual
        self.log = Log(settings.frame)
        self.work = (0.0, 0.0)
        self.begin()

    @property
    def dynamics(self) -> Dynamics:
        """The dynamics of the problem."""
        dynamics = self.problem.dynamics
        assert dynamics is not None  # see `completed`
        return dynamics

    # --- at the begin, and after a change of the body -----------------------------------------------------------

    def begin(self) -> None:
        """Bring the present body to its begin, without grasps and spheres."""
        self.held = Held()
        self.build()
        self.moment = self.first_moment()
        scheme = self.mover.stepper.name.split(",")[0]
        self.begun = Begun(self.problem, self.model, self.share, scheme, self.mover.longest, self._start)

    def build(self, ready: Built | None = None) -> None:
        """Build the body of the present problem and model, unless it is ready, and choose how it moves."""
        self.built = built(self.problem, self.model) if ready is None else ready
        plain, frame = self.built.body, self.settings.frame
        stable = self.built.stable if 0 < self.built.stable < np.inf else frame
        self.sizes = Sizes(self.problem, plain.potential, plain.mass, plain.size, stable)
        self.weight = self.gravity.weight(plain.mass, self.share)
        self.body = weighted(plain, self.weight)
        self.mover = Mover(plain, stable, self._choice(), frame, self.notes)

    def choose(self, settings: Settings) -> None:
        """Take other steps from now on."""
        self.settings = settings
        self.mover.take(self._choice())

    def _choice(self) -> Choice:
        """Return how steps are taken."""
        dynamics, settings = self.dynamics, self.settings
        wanted = dynamics.scheme if settings.scheme == "auto" else settings.scheme
        asked = dynamics.step if settings.step == "auto" else settings.step
        step = float(asked) if isinstance(asked, int | float) else None
        of = self.built.body, self.built.geometry, self.built.stable
        schemes = Schemes(*of, settings.frame, step, settings.iterations)
        choice = schemes.chosen(self.decided or wanted if wanted == "auto" else wanted)
        if wanted == "auto" and self.decided is None:
            self.decided, self.why = choice.scheme, choice.why
            if choice.slow:
                self.notes.append(choice.why)
        return choice

    def first_moment(self) -> Moment:
        """Return the state at the begin: at rest or at the equilibrium, as the dynamics of the problem say."""
        begin = begin_of(self.body, self.dynamics, Newton(), None, self.built.geometry)
        positions, self._start = begin.positions, self.dynamics.start if begin.converged else "rest"
        if not begin.converged:
            self.notes.append(f"{begin.reason}; it begins undeformed")
            positions = self.body.placed(self.body.potential.nodes, 0.0)
        velocity = np.zeros_like(positions)
        if self.dynamics.velocity is not None:
            velocity = np.where(self.body.held, 0.0, self.dynamics.velocity)
        return Moment(0.0, positions, velocity)

    def changed(self, problem: Problem) -> Problem:
        """Return a problem as stated with the present materials and dynamics."""
        stiffer, poisson = self.changes.get("young", 1.0), self.changes.get("poisson")

        def changed(one: Material) -> Material:
            return replace(one, young=stiffer * one.young, poisson=one.poisson if poisson is None else poisson)

        if not self.changes and problem.dynamics is self.dynamics:
            return problem
        return replace(problem.with_materials(changed), dynamics=self.dynamics)

    # --- how it moves -------------------------------------------------------------------------------------------

    @property
    def acting(self) -> Acting:
        """What acts on the body within the present frame."""
        held = self.held
        return Acting(tuple(held.grips.values()), tuple(held.balls.values()), self.sizes.touched, self.weight)

    def advance(self) -> bool:
        """Advance by a frame; return False if the motion became unstable, and leave the body where it was."""
        self.held.aim(self.sizes.size)
        taken = self.mover.frame(self.moment, self.acting)
        self.log.frames += 1
        if not taken.is_found:
            return False
        self.moment, self.work = taken.moment, (taken.done, taken.damped)
        self.held.feel(taken.forces)
        for name in self.held.moving:
            self.note_place(name)
        self.held.settle()
        if self.weight.moves:
            self.settle()
        return True

    def settle(self) -> None:
        """Take gravity as it was asked for, without a frame in which it changes."""
        self.weight = self.weight.settled
        self.body = weighted(self.built.body, self.weight)

    def go_on(self, state: State, moment: Moment | None) -> None:
        """Go on from the state of another session of the body, or with its grasps and spheres from `moment`."""
        self.moment = state.moment if moment is None else moment
        self.held.go_on(state, self.sizes.acted_on)
        self.weight = replace(self.weight, begin=state.gravity[0], end=state.gravity[1])
        self.mover.stepper.forget()
        self.mover.stepper.before = state.before if moment is None else None

    def note_place(self, name: str) -> None:
        """Write down where a grasp or sphere is at the present number of frames."""
        self.log.places.append((self.log.frames, name, tuple(self.held.place(name).tolist())))

    def note(self, words: str) -> None:
        """Add a sentence with the time to the notes."""
        self.notes.append(f"{self.moment.time:.4g} s: {words}")
