"""A live session: the one mutable object, in front of the same steps as a motion that is computed to its end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import TracebackType
from typing import NamedTuple, Self, TypeVar

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.dynamics import Damping, Dynamics, Energies
from truespring.errors import LiveError, TruespringError
from truespring.live.actions import Ball, Grip, HasBody, Weight
from truespring.live.choosing import Schemes
from truespring.live.commands import Command, Log, checked
from truespring.live.completed import completed, with_materials
from truespring.live.cut import (
    Aside,
    Built,
    Prepared,
    Whole,
    built,
    cut_words,
    kept_grips,
    kept_moment,
    kept_rows,
    loose_parts,
)
from truespring.live.state import State
from truespring.live.steppers import Acting, Frame
from truespring.loading import Body as LoadedBody
from truespring.material import Material
from truespring.models import Model, as_model
from truespring.motion.follow import begin_of
from truespring.motion.moving import Body
from truespring.motion.stages import Moment
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.solvers import Geometry, Newton
from truespring.tools import Grasp
from truespring.tools.surface import surface

#: Time between frames by default [s].
FRAME = 1 / 60
#: Gravity of a body without such a load [m/s^2], against the last direction.
GRAVITY = 9.81
# Radius of a grasp by default: the larger of these shares of a typical edge and of the size of the body.
_PATCH, _SHARE = 1.6, 0.05
# Stiffness of a pin over that of a grasp.
_PINNED = 10.0
# Energy that a frame may gain without work, over the largest energy so far: more is an instability.
_GAIN = 0.05
# An oscillation over the size of the body that is no instability but a rounding error.
_SMALL = 1e-7
# The step is halved up to so many times.
_HALVINGS = 6
# Largest motion in a frame: of a sphere over its radius, of a grasp over the size of the body.
_FASTEST_BALL, _FASTEST_GRIP = 0.5, 0.25
# The stiffness of a contact on a node is at most this share of the stiffness that limits the step.
_CONTACT = 0.5
Part = TypeVar("Part", Grip, Ball)

# A step may exceed the planned one by this share, a rounding error.
_SAME = 1e-9


@dataclass(frozen=True)
class Settings:
    """How a session takes its steps.

    Attributes:
        frame: time between frames [s]; commands act from one frame to the next.
        scheme: "auto", or a scheme of `Dynamics`.
        step: longest time step [s]; "auto" for what the scheme allows.
        iterations: Newton iterations of an implicit step; 0 solves it.
    """

    frame: float = FRAME
    scheme: str = "auto"
    step: float | str = "auto"
    iterations: int = 0


class Begun(NamedTuple):
    """What a session begins with, at first or after a restart.

    Attributes:
        problem: the completed problem, with changed material and damping.
        model: the model.
        gravity: the share of gravity [-].
        scheme: the scheme, a word of `Dynamics`.
        longest: the longest time step [s].
        start: "rest", or "equilibrium" if that was found.
    """

    problem: Problem
    model: Model
    gravity: float
    scheme: str
    longest: float
    start: str


class Live:
    """A body that moves while it is pulled, pushed and pinned: call `pull` and the like, then `step`.

    Each call of `step` advances the body by one frame. What was asked before it acts linearly over that frame, so that
    a pull that moves at each frame is a path of straight lines in time, as that of a `Grasp`.

    Attributes:
        problem: the problem, completed: a body without `dynamics` begins at its equilibrium, one without density has
            that of water.
        model: the model.
        settings: how steps are taken.
        notes: what was assumed, and what happened, in sentences.
        why: why steps are taken as they are, if that was chosen by measuring their time, else "".
        log: the commands since the begin.
        begun: what the session begins with.

    Example:
        >>> import truespring as ts
        >>> beam = ts.Problem(
        ...     ts.box((0.04, 0.01, 0.01), (4, 1, 1)),
        ...     ts.Material(young=3000.0, poisson=0.4, density=1000.0),
        ...     supports=ts.Fixed(on="left"),
        ...     loads=ts.Gravity((0.0, 0.0, -9.81)),
        ... )
        >>> with ts.Live(beam, ts.Springs(rule="gaussian")) as live:
        ...     name = live.pull((0.04, 0.01, 0.01), to=(0.04, 0.012, 0.01))  # metres
        ...     live.step(30)  # half a second
        ...     name, round(live.time, 6), live.positions.shape
        ('pull', 0.5, (20, 3))
        >>> bool(live.forces["pull"][1] < 0)  # the body pulls back, down
        True
    """

    def __init__(
        self,
        problem: Problem,
        model: Model | Potential,
        *,
        models: Mapping[str, Model] | None = None,
        frame: float = FRAME,
        scheme: str = "auto",
        step: float | str = "auto",
        iterations: int = 0,
    ) -> None:
        """Bring the body to its begin.

        Args:
            problem: body, supports and loads.
            model: the model of the body.
            models: models to which the command "model" changes, by name.
            frame: time between frames [s].
            scheme: "leapfrog", "bdf2", "midpoint", "euler", or "auto": leapfrog, unless it has no stable
                step, or takes longer than a frame and bdf2 takes less.
            step: longest time step [s]; "auto" for that of the problem, or half of leapfrog's stable step.
            iterations: Newton iterations of each step of an implicit scheme; 0 solves it.

        Raises ProblemError and ModelError as `solve`, LiveError if the scheme cannot be used.
        """
        self.notes: list[str] = []
        self._decided: str | None = None  # the scheme of "auto", once it is chosen
        self.why = ""
        self.settings = Settings(frame, scheme, step, iterations)
        self.model = as_model(model)
        self.problem, notes = completed(problem)
        self.notes.extend(notes)
        self._whole = self._left = Whole.of(self.problem, self.model, dict(models or {}))
        self._aside = Aside()
        self._changes: dict[str, float] = {}
        self._gravity = 1.0 if self._own_gravity is not None else 0.0
        self.log = Log(frame)
        self._clear()
        self._build()
        self._moment = self._begin()
        self.begun = self._begun()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the session: it cannot be advanced any more."""
        self._aside.forget()
        self._stepper.forget()

    @property
    def _dynamics(self) -> Dynamics:
        dynamics = self.problem.dynamics
        assert dynamics is not None  # see `completed`
        return dynamics

    def _clear(self) -> None:
        """Remove grasps and spheres."""
        self._grips: dict[str, Grip] = {}
        self._balls: dict[str, Ball] = {}
        self._targets: dict[str, Floats] = {}
        self._forces: Floats = np.zeros((0, self.dim))

    def _build(self, ready: Built | None = None) -> None:
        """Build the body of the present problem and model, unless it is ready, and choose how it moves."""
        made = built(self.problem, self.model) if ready is None else ready
        for size in ("surface", "touched", "edge", "contact_stiffness"):
            self.__dict__.pop(size, None)
        self._plain, self._geometry, self._stable, self._known = made.body, made.geometry, made.stable, None
        self._weight = self._weight_of(self._gravity)
        self.body = self._weighted()
        self._halved, self._largest = 0, 0.0
        self._choose()

    def _choose(self) -> None:
        """Choose how steps are taken."""
        dynamics, settings = self._dynamics, self.settings
        wanted = dynamics.scheme if settings.scheme == "auto" else settings.scheme
        asked = dynamics.step if settings.step == "auto" else settings.step
        step = float(asked) if isinstance(asked, int | float) else None
        schemes = Schemes(self._plain, self._geometry, self._stable, settings.frame, step, settings.iterations)
        choice = schemes.chosen(self._decided or wanted if wanted == "auto" else wanted)
        self._stepper, self._longest = choice.stepper, choice.longest
        if wanted == "auto" and self._decided is None:
            self._decided, self.why = choice.scheme, choice.why
            if choice.slow:
                self.notes.append(choice.why)

    def _begin(self) -> Moment:
        """Return the state at the begin: at rest or at the equilibrium, as the dynamics of the problem say."""
        begin = begin_of(self.body, self._dynamics, Newton(), None, self._geometry)
        positions, self._start = begin.positions, self._dynamics.start if begin.converged else "rest"
        if not begin.converged:
            self.notes.append(f"{begin.reason}; it begins undeformed")
            positions = self.body.placed(self.body.potential.nodes, 0.0)
        velocity = np.zeros_like(positions)
        if self._dynamics.velocity is not None:
            velocity = np.where(self.body.held, 0.0, self._dynamics.velocity)
        return Moment(0.0, positions, velocity)

    def _begun(self) -> Begun:
        """Return what the session begins with, for its record."""
        return Begun(self.problem, self.model, self._gravity, self.scheme.split(",")[0], self._longest, self._start)

    # --- what it is ---------------------------------------------------------------------------------------------

    @property
    def dim(self) -> int:
        """Number of directions."""
        return self.problem.mesh.dim

    @property
    def moment(self) -> Moment:
        """The state, with the further nodes of second-order elements."""
        return self._moment

    @property
    def state(self) -> State:
        """The state with all that holds the body, for another session."""
        held = dict(self._grips), dict(self._balls), dict(self._targets)
        gravity = self._weight.begin, self._weight.end
        return State(self.log.frames, self._moment, *held, gravity, self._stepper.before)

    def go_on(self, state: State, moment: Moment | None = None) -> None:
        """Go on from the state of another session of the body, or with its grasps and spheres from `moment`."""
        self._moment = state.moment if moment is None else moment
        self._grips = {name: one.on(self.acted_on) for name, one in state.grips.items()}
        self._balls = dict(state.balls)
        self._targets = dict(state.targets)
        self._weight = replace(self._weight, begin=state.gravity[0], end=state.gravity[1])
        self._stepper.forget()
        self._stepper.before = state.before if moment is None else None

    def settle(self) -> None:
        """Take gravity as it was asked for, without a frame in which it changes."""
        self._weight = self._weight.settled
        self.body = self._weighted()

    def choose(self, scheme: str, step: float | str, iterations: int) -> None:
        """Take other steps from now on, see `Settings`."""
        self.settings = replace(self.settings, scheme=scheme, step=step, iterations=iterations)
        before = self._stepper.before
        self._choose()
        self._stepper.before = before

    @property
    def time(self) -> float:
        """The time [s]."""
        return self._moment.time

    @property
    def positions(self) -> Floats:
        """Positions of the nodes of the mesh [m], shape (n_nodes, dim); a copy."""
        return self._moment.positions[: self.problem.mesh.n_nodes].copy()

    @property
    def velocities(self) -> Floats:
        """Velocities of the nodes of the mesh [m/s], shape (n_nodes, dim); a copy."""
        return self._moment.velocity[: self.problem.mesh.n_nodes].copy()

    @property
    def geometry(self) -> Geometry:
        """Functions of the mesh for solvers."""
        return self._geometry

    @property
    def models(self) -> Mapping[str, Model]:
        """The models to which the command "model" changes, by name."""
        return self._left.models

    @property
    def gravity_share(self) -> float:
        """What gravity is multiplied by, see `gravity`."""
        return self._gravity

    @property
    def scheme(self) -> str:
        """How steps are taken, in words."""
        return self._stepper.name

    @property
    def steps_a_frame(self) -> int:
        """The number of steps of a frame."""
        return steps_in(self.settings.frame, self._longest / 2**self._halved)

    @property
    def halved(self) -> bool:
        """Whether the step was halved because energy rose without work."""
        return self._halved > 0

    @property
    def step_length(self) -> float:
        """The time step [s]."""
        return self.settings.frame / self.steps_a_frame

    @property
    def grasps(self) -> Mapping[str, Grip]:
        """Grasps and pins by name."""
        return self._grips

    @property
    def spheres(self) -> Mapping[str, Ball]:
        """Spheres by name."""
        return self._balls

    @property
    def forces(self) -> dict[str, Floats]:
        """Force of the body on each grasp and sphere at the end of the last frame [N], shape (dim,), by name."""
        known = dict(zip(self._acted, self._forces, strict=True))
        return {name: known[name] for name in (*self._grips, *self._balls) if name in known}

    _acted: tuple[str, ...] = ()

    @cached_property
    def surface(self) -> tuple[Ints, Floats]:
        """Nodes of the surface, and their shares of its undeformed area [m^2], shape (n,) each.

        Of a network of springs, which has no surface, all nodes without area.
        """
        mesh = self.problem.mesh
        if mesh.element == "line":
            return np.arange(mesh.n_nodes), np.zeros(mesh.n_nodes)
        return surface(self.problem.body, None)

    @property
    def acted_on(self) -> LoadedBody:
        """The body that grasps and spheres act on, with the further nodes of second-order elements."""
        potential = self.body.potential
        return potential.body if isinstance(potential, HasBody) else self.problem.body

    @cached_property
    def touched(self) -> tuple[Ints, Floats]:
        """As `surface`, with the further nodes of second-order elements: what spheres push."""
        body = self.acted_on
        return self.surface if body.second_order is None else surface(body, None)

    @cached_property
    def edge(self) -> float:
        """A typical edge of an element [m]."""
        mesh = self.problem.mesh
        return float(np.median(np.abs(mesh.measures)) ** (1 / mesh.dim))

    @property
    def size(self) -> float:
        """The diagonal of the undeformed body's bounding box [m]."""
        return self.body.size

    def energies(self) -> Energies:
        """Return the energies; work and dissipation are those of the last frame."""
        body, moment = self.body, self._moment
        kinetic = float(np.einsum("n,ni,ni->", body.mass, moment.velocity, moment.velocity)) / 2
        elastic, (done, damped) = body.potential.energy(moment.positions), self._work
        return Energies(kinetic, elastic, -done, self._acting.stored(moment.positions), damped, 0.0)

    _work: tuple[float, float] = (0.0, 0.0)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What should not be trusted in the present state."""
        ratio = self.problem.mesh.smallest_area_ratio(self.positions)
        return () if ratio > 0 else (f"inverted: the smallest corner Jacobian is {ratio:.2g} of that at rest",)

    # --- what is asked of it ------------------------------------------------------------------------------------

    def pull(
        self,
        point: int | Sequence[float],
        to: Sequence[float] | None = None,
        *,
        name: str = "pull",
        radius: float | None = None,
        stiffness: float | None = None,
    ) -> str:
        """Hold the patch around a point by springs and move it; return the name of the grasp.

        Args:
            point: number of a node, or a place on the body as it is now [m]: the nearest node of the surface.
            to: where the point is at the end of the next frame [m]; None to hold it where it is.
            name: name of the grasp; one of this name is moved, whatever the point.
            radius: distance within which nodes of the surface are held [m]; None for 1.6 typical edges, at least 5 % of
                the size of the body.
            stiffness: of all springs together [N/m]; None for Young's modulus times the radius.
        """
        if name not in self._grips:
            node = self.node_at(point)
            radius = self.patch if radius is None else radius
            place, value = self._undeformed(node), self._grasp_stiffness(radius, stiffness)
            self.do("grasp", name, place, radius, value)
        if to is not None:
            self.do("move", name, to)
        return name

    def pin(self, point: int | Sequence[float], *, name: str = "pin", radius: float | None = None) -> str:
        """Hold the patch around a point where it is, by stiff springs; return the name; arguments as `pull`."""
        radius = self.patch if radius is None else radius
        place = self._undeformed(self.node_at(point))
        self.do("grasp", name, place, radius, _PINNED * self._grasp_stiffness(radius, None))
        return name

    def push(self, to: Sequence[float], *, name: str = "sphere", radius: float | None = None) -> str:
        """Move a sphere to a place [m], or add it there; return its name.

        A sphere moves by at most half of its radius in a frame. `radius` [m] is that of a new one, by default 10 % of
        the size of the body.
        """
        if name in self._balls:
            self.do("move", name, to)
        else:
            self.do("sphere", name, to, 2 * _SHARE * self.size if radius is None else radius, self.contact_stiffness)
        return name

    def release(self, name: str) -> None:
        """Remove a grasp, pin or sphere."""
        self.do("release", name)

    def gravity(self, share: float) -> None:
        """Multiply gravity: 1 for that of the problem, or 9.81 m/s^2 against the last direction if it has none."""
        self.do("gravity", value=share)

    def cut(
        self,
        start: Sequence[float],
        end: Sequence[float],
        depth: Sequence[float] | None = None,
        *,
        aside: bool = False,
    ) -> None:
        """Remove the elements that a plane blade passes, with their springs, volume term and mass.

        Nodes that belong to no element any more are gone; the others keep their places and velocities. Loads and
        supports stay on what remains of where they were. A blade that lies in facets between elements passes those on
        one side, that of the vector product of the way from start to end and the depth, in the plane that to the left.

        Args:
            start: where the blade begins, on the body as it is now [m].
            end: where it ends [m].
            depth: how deep it passes, a vector from there [m]; None in the plane.
            aside: build the cut body in another thread, while the body moves on; it is cut at the begin of the first
                frame for which that is ready.

        Raises LiveError for a blade without length or area, and if no element would remain; ModelError if the model
        cannot be cut.
        """
        place = [*start, *end, *(() if depth is None else depth)]
        if not aside:
            self.do("cut", place=place)
            return
        command = checked(Command(self.log.frames, "cut", place=tuple(float(one) for one in place)), self.dim)
        removed = self._left.numbers_of(command, self.positions)
        command = replace(command, elements=tuple(removed.tolist()))
        self._aside.begin(command, self.problem, self.model, self._prepared)

    @property
    def is_cutting(self) -> bool:
        """Whether a cut is built in another thread."""
        return self._aside.command is not None

    @property
    def nodes_left(self) -> Ints:
        """Numbers in the uncut body of the nodes of the mesh, ascending, shape (n_nodes,)."""
        return self._left.nodes

    @property
    def elements_left(self) -> Ints:
        """Numbers in the uncut body of the elements of the mesh, ascending, shape (n_elements,)."""
        return self._left.elements

    def restart(self) -> None:
        """Bring the body back to its begin, without cuts, grasps and spheres."""
        self.do("restart")

    def do(
        self,
        kind: str,
        name: str = "",
        place: Sequence[float] = (),
        radius: float | None = None,
        value: float | None = None,
    ) -> None:
        """Carry out a command, one of COMMANDS, before the next frame; raise LiveError if it is wrong."""
        there = tuple(float(one) for one in place)
        self.repeat(Command(self.log.frames, kind, name, there, radius, value))

    def repeat(self, command: Command) -> None:
        """Carry out a command of another session of the body before the next frame.

        A grasp begins where it did there, a cut removes what it removed there. The models of the two sessions may
        differ. Raises LiveError if the command is wrong.
        """
        command = checked(replace(command, frame=self.log.frames), self.dim)
        command = self._carried_out(command)
        if command.kind == "restart":
            self.log = self.log.begun_again()
        else:
            self.log.commands.append(command)

    def _carried_out(self, command: Command) -> Command:
        """Carry out a command that is checked; return it with what another session needs to repeat it."""
        carried: Mapping[str, Callable[[Command], Command | None]] = {
            "grasp": self._do_grasp,
            "sphere": self._do_sphere,
            "move": self._do_move,
            "release": self._do_release,
            "gravity": self._do_gravity,
            "young": self._do_material,
            "poisson": self._do_material,
            "damping": self._do_damping,
            "model": self._do_model,
            "cut": self._do_cut,
            "restart": self._do_restart,
        }
        return carried[command.kind](command) or command

    def _do_grasp(self, command: Command) -> Command:
        self._require_free(command.name)
        at, radius = np.array(command.place), command.radius
        assert radius is not None and command.value is not None  # see `checked`
        body, still = self.acted_on, np.zeros(self.dim)
        nodes, stiffness = Grasp(command.name, command.place, radius, command.place, command.value).patch(body, None)
        grip = Grip(command.name, at, radius, nodes, stiffness, body.nodes[nodes], still, still, self.time)
        motion = np.array(command.begin) if command.begin else grip.mean_motion(self._moment.positions)
        self._grips[command.name] = replace(grip, begin=motion, end=motion)
        self._targets[command.name] = motion
        self._note_place(command.name)
        return replace(command, begin=tuple(motion.tolist()))

    def _do_sphere(self, command: Command) -> None:
        self._require_free(command.name)
        centre = np.array(command.place)
        assert command.radius is not None and command.value is not None  # see `checked`
        self._balls[command.name] = Ball(command.name, command.radius, command.value, centre, centre, self.time)
        self._targets[command.name] = centre
        self._note_place(command.name)

    def _do_move(self, command: Command) -> None:
        place = np.array(command.place)
        if command.name in self._grips:
            place = place - self._grips[command.name].at
        elif command.name not in self._balls:
            raise self._unknown(command.name)
        self._targets[command.name] = place

    def _do_release(self, command: Command) -> None:
        if command.name not in self._targets:
            raise self._unknown(command.name)
        for several in (self._grips, self._balls, self._targets):
            several.pop(command.name, None)

    def _do_gravity(self, command: Command) -> None:
        assert command.value is not None  # see `checked`
        self._gravity = command.value
        self._weight = replace(self._weight, end=self._weight_of(command.value).end)

    def _do_material(self, command: Command) -> None:
        assert command.value is not None  # see `checked`
        self._changes[command.kind] = command.value
        self.problem = self._changed(self._left.problem)
        self._build()

    def _changed(self, problem: Problem) -> Problem:
        """Return a problem as stated with the present materials and dynamics."""
        stiffer, poisson = self._changes.get("young", 1.0), self._changes.get("poisson")

        def changed(one: Material) -> Material:
            return replace(one, young=stiffer * one.young, poisson=one.poisson if poisson is None else poisson)

        if not self._changes and problem.dynamics is self._dynamics:
            return problem
        return replace(with_materials(problem, changed), dynamics=self._dynamics)

    def _do_damping(self, command: Command) -> None:
        assert command.value is not None  # see `checked`
        damping = Damping(self._dynamics.damping.stiffness, command.value)
        self.problem = replace(self.problem, dynamics=replace(self._dynamics, damping=damping))
        self._build()

    def _do_model(self, command: Command) -> None:
        if command.name not in self.models:
            raise LiveError(f"model '{command.name}' is unknown; allowed: {', '.join(self.models) or 'none'}")
        self.model, self._decided = self._left.models[command.name], None
        before = self._moment
        self._build()
        if len(self.body.potential.nodes) != len(before.positions):
            self._moment = self._begin()

    def _do_cut(self, command: Command) -> Command:
        removed = self._left.numbers_of(command, self.positions)
        command = replace(command, elements=tuple(removed.tolist()))
        if len(removed):
            self._take(self._aside.made(command, self.problem, self.model) or self._prepared(command), command)
        else:
            self.notes.append(f"{self.time:.4g} s: the blade of a cut passes no element")
        return command

    def _prepared(self, command: Command) -> Prepared:
        """Return the body that a cut leaves, ready to move; the session is not changed."""
        left, of = self._left.without(command, self.model)
        problem = self._changed(left.problem)
        return Prepared(left, of, problem, built(problem, left.model))

    def _take(self, cut: Prepared, command: Command) -> None:
        """Go on with what a cut leaves, its nodes where they are, with their velocities."""
        before, rows = self.body.potential, kept_rows(cut.of, self.body.potential, cut.built.body.potential)
        self._left, self.problem, self.model = cut.left, cut.problem, cut.left.model
        self._moment = kept_moment(self._moment, rows)
        grips = kept_grips(self._grips, rows, len(before.nodes))
        gone = [*cut.left.lost, *(self._grips.keys() - grips.keys())]
        self._grips = grips
        self._targets = {name: one for name, one in self._targets.items() if name in grips or name in self._balls}
        self._build(cut.built)
        held = [np.flatnonzero(self.body.held[: self.problem.mesh.n_nodes].any(axis=1))]
        held += [one.nodes for one in self._grips.values()]
        parts = loose_parts(self.problem.mesh, np.concatenate(held))
        self.notes.append(f"{self.time:.4g} s: {cut_words(len(command.elements or ()), *parts, gone)}")

    def _do_restart(self, command: Command) -> None:
        self._aside.forget()
        self._clear()
        if self._left is not self._whole:
            self._left, self.model = self._whole, self._whole.model
            self.problem = self._changed(self._whole.problem)
        self._build()
        self._moment = self._begin()
        self.begun = self._begun()

    def _require_free(self, name: str) -> None:
        """Raise LiveError if a grasp or sphere has a name."""
        if name in self._targets:
            raise LiveError(f"'{name}' is there already: release it first, or take another name")

    def _unknown(self, name: str) -> LiveError:
        return LiveError(f"'{name}' is no grasp, pin or sphere; there are: {', '.join(self._targets) or 'none'}")

    # --- how it moves -------------------------------------------------------------------------------------------

    def step(self, frames: int = 1) -> None:
        """Advance by a number of frames."""
        for _ in range(frames):
            self._frame()

    @property
    def _acting(self) -> Acting:
        return Acting(tuple(self._grips.values()), tuple(self._balls.values()), self.touched, self._weight)

    def _frame(self) -> None:
        """Advance by a frame; halve the step where energy rises without work."""
        self._cut_what_is_ready()
        self._aim()
        acting = self._acting
        taken = self._stepper.frame(self._moment, acting, self.steps_a_frame, self.step_length)
        while not self._sound(taken, acting) and self._halved < _HALVINGS:
            self._halved += 1
            self._stepper.forget()
            self.notes.append(
                f"{self.time:.4g} s: energy rose without work, the step is halved: {self.step_length:.3g} s"
            )
            taken = self._stepper.frame(self._moment, acting, self.steps_a_frame, self.step_length)
        self.log.frames += 1
        if not taken.solved or not np.isfinite(taken.moment.positions).all():
            self.notes.append(f"{self.time:.4g} s: the motion became unstable: the body begins again")
            self.restart()
            return
        self._moment, self._forces, self._work = taken.moment, taken.forces, (taken.done, taken.damped)
        self._acted = (*self._grips, *self._balls)
        for name in [name for several in (self._grips, self._balls) for name, one in several.items() if one.moves]:
            self._note_place(name)
        self._grips = {name: one.settled for name, one in self._grips.items()}
        self._balls = {name: one.settled for name, one in self._balls.items()}
        if self._weight.moves:
            self.settle()

    def _cut_what_is_ready(self) -> None:
        """Carry out the cut that another thread has built, if there is one."""
        command = self._aside.ready()
        try:
            if command is not None:
                self.repeat(command)
        except TruespringError as error:  # asked in an earlier frame: nothing that asked it waits for an answer
            self.notes.append(f"{self.time:.4g} s: {error}")
        finally:
            if command is not None:
                self._aside.forget()

    def _aim(self) -> None:
        """Let grasps and spheres move towards where they were asked to go, at most as fast as is allowed."""
        for name, grip in self._grips.items():
            self._grips[name] = grip.to(_towards(grip.begin, self._targets[name], _FASTEST_GRIP * self.size))
        for name, ball in self._balls.items():
            self._balls[name] = ball.to(_towards(ball.begin, self._targets[name], _FASTEST_BALL * ball.radius))

    def _sound(self, taken: Frame, acting: Acting) -> bool:
        """Return whether the energy after a frame is explained by the work in it."""
        if not taken.solved or not np.isfinite(taken.moment.positions).all():
            return False
        begins = replace(acting, grips=_begins(acting.grips), balls=_begins(acting.balls))
        before = self._energy(self._moment, begins)
        after = self._energy(taken.moment, acting)
        if not np.isfinite(after):  # an inverted element: its energy is not known
            after = self._kinetic(taken.moment)
        before = before if np.isfinite(before) else after
        self._largest = max(self._largest, abs(taken.done), before, self._rounding)
        return after - before - taken.done + taken.damped <= _GAIN * self._largest

    @property
    def _rounding(self) -> float:
        """An energy far above rounding errors [J]: of an oscillation by _SMALL of the size that limits the step."""
        step = self._stable if 0 < self._stable < np.inf else self.settings.frame
        return float(self.body.mass.sum()) * (_SMALL * self.size / step) ** 2

    def _energy(self, moment: Moment, acting: Acting) -> float:
        """Return kinetic and stored energy [J]."""
        known = self._known
        if known is None or known[0] is not moment:  # that at the end of a frame is that at the begin of the next
            self._known = known = moment, self._kinetic(moment) + self._stepper.elastic(moment.positions)
        return known[1] + acting.stored(moment.positions)

    _known: tuple[Moment, float] | None = None

    def _kinetic(self, moment: Moment) -> float:
        return float(np.einsum("n,ni,ni->", self.body.mass, moment.velocity, moment.velocity)) / 2

    def _note_place(self, name: str) -> None:
        """Write down where a grasp or sphere is at the present number of frames."""
        one = self._grips.get(name) or self._balls[name]
        self.log.places.append((self.log.frames, name, tuple(one.place.tolist())))

    # --- sizes --------------------------------------------------------------------------------------------------

    @property
    def patch(self) -> float:
        """The radius of a grasp by default [m]."""
        return max(_PATCH * self.edge, _SHARE * self.size)

    @cached_property
    def contact_stiffness(self) -> float:
        """The pressure per depth of a sphere [Pa/m]: that which does not shorten the step much."""
        nodes, areas = self.touched
        stable = self._stable if np.isfinite(self._stable) and self._stable > 0 else self.settings.frame
        stiffest = float((areas / self.body.mass[nodes]).max())
        if not stiffest:
            raise LiveError("a sphere needs the surface of elements, and the body is a network of springs")
        return _CONTACT * (2 / stable) ** 2 / stiffest

    def node_at(self, point: int | Sequence[float]) -> int:
        """Return the number of the node of the surface that is nearest to a place on the body as it is now [m]."""
        nodes, _ = self.surface
        if isinstance(point, int | np.integer):
            if not 0 <= point < self.problem.mesh.n_nodes:
                raise LiveError(f"node {point}: the body has nodes 0 to {self.problem.mesh.n_nodes - 1}")
            return int(point)
        away = self._moment.positions[nodes] - np.asarray(point, dtype=float)
        return int(nodes[(away**2).sum(axis=1).argmin()])

    def _undeformed(self, node: int) -> list[float]:
        """Return the undeformed place of a node [m]."""
        return [float(one) for one in self.problem.mesh.nodes[node]]

    def _grasp_stiffness(self, radius: float, stiffness: float | None) -> float:
        """Return the stiffness of a grasp [N/m], by default Young's modulus times the radius."""
        if stiffness is not None:
            return stiffness
        young = max((one.young for one in self.problem.materials), default=None)
        if young is None:
            raise LiveError("the stiffness of a grasp is required for a body without a material [N/m]")
        return young * (radius if self.dim == 3 else self.problem.body.thickness)

    # --- gravity ------------------------------------------------------------------------------------------------

    @cached_property
    def _own_gravity(self) -> Floats | None:
        """The acceleration of the problem's loads on the whole body [m/s^2], shape (dim,); None without such a load."""
        own = [one for load in self._whole.problem.loads if (one := load.acceleration_of_body) is not None]
        return np.asarray(np.sum(own, axis=0)) if own else None

    @property
    def full_gravity(self) -> Floats:
        """The acceleration of gravity at share 1 [m/s^2], shape (dim,)."""
        down = np.zeros(self.dim)
        down[-1] = -GRAVITY
        return down if self._own_gravity is None else self._own_gravity

    def _weight_of(self, share: float) -> Weight:
        """Return the weight beyond the loads of the problem at a share of gravity."""
        more = share if self._own_gravity is None else share - 1
        return Weight(self._plain.mass[:, None] * self.full_gravity, more, more)

    def _weighted(self) -> Body:
        """Return the body with the present weight."""
        plain = self._plain
        loading = self._weight.settled.added_to(plain.loading, (0.0, plain.duration), plain.duration)
        return replace(plain, loading=loading)


def steps_in(frame: float, longest: float) -> int:
    """Return the number of steps of a frame [s] of at most a length [s]."""
    return max(1, int(np.ceil(frame / longest - _SAME)))


def replayed(live: Live, commands: Sequence[Command], frames: int) -> Live:
    """Return a session after it was given commands again, each before the frame that it was given before."""
    left = list(commands)
    for frame in range(frames):
        while left and left[0].frame <= frame:
            live.repeat(left.pop(0))
        live.step()
    return live


def _begins(several: Sequence[Part]) -> tuple[Part, ...]:
    """Return grasps or spheres at the begin of the frame."""
    return tuple(replace(one, end=one.begin) for one in several)


def _towards(begin: Floats, target: Floats, fastest: float) -> Floats:
    """Return the target [m], shape (dim,), or the place on the way to it at the largest distance from the begin."""
    away = target - begin
    far = float(np.linalg.norm(away))
    return target if far <= fastest else np.asarray(begin + fastest / far * away)
