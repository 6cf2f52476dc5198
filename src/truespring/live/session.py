"""A live session: the one mutable object, in front of the same steps as a motion that is computed to its end."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Self

from truespring.errors import TruespringError
from truespring.live.carried import carried_out
from truespring.live.commands import Command, checked
from truespring.live.core import Core
from truespring.live.cutting import begin_aside
from truespring.live.readings import Readings
from truespring.live.settings import FRAME, Settings
from truespring.live.state import State
from truespring.models import Model
from truespring.motion.stages import Moment
from truespring.potential import Potential
from truespring.problem import Problem

# Stiffness of a pin over that of a grasp.
_PINNED = 10.0


class Live(Readings):
    """A body that moves while it is pulled, pushed and pinned: call `pull` and the like, then `step`.

    Each call of `step` advances the body by one frame. What was asked before it acts linearly over that frame, so that
    a pull that moves at each frame is a path of straight lines in time, as that of a `Grasp`.

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
            scheme: "leapfrog", "bdf2", "midpoint", "euler", or "auto": that of the problem; if that is "auto", too,
                leapfrog, and bdf2 for a body without a stable step or with more than 1000 steps a frame.
            step: longest time step [s]; "auto" for that of the problem. Leapfrog takes at most half of its stable step.
            iterations: Newton iterations of each step of an implicit scheme; 0 solves it.

        Raises ProblemError and ModelError as `solve`, LiveError if the scheme cannot be used.
        """
        super().__init__(Core(problem, model, models or {}, Settings(frame, scheme, step, iterations)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the session: it cannot be advanced any more."""
        self._core.aside.forget()
        self._core.mover.stepper.forget()

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
        if name not in self.grasps:
            node = self.node_at(point)
            radius = self.patch if radius is None else radius
            place, value = self._core.sizes.undeformed(node), self._core.sizes.grasp_stiffness(radius, stiffness)
            self.do("grasp", name, place, radius, value)
        if to is not None:
            self.do("move", name, to)
        return name

    def pin(self, point: int | Sequence[float], *, name: str = "pin", radius: float | None = None) -> str:
        """Hold the patch around a point where it is, by stiff springs; return the name; arguments as `pull`."""
        radius = self.patch if radius is None else radius
        place = self._core.sizes.undeformed(self.node_at(point))
        self.do("grasp", name, place, radius, _PINNED * self._core.sizes.grasp_stiffness(radius, None))
        return name

    def push(self, to: Sequence[float], *, name: str = "sphere", radius: float | None = None) -> str:
        """Move a sphere to a place [m], or add it there; return its name.

        A sphere moves by at most half of its radius in a frame. `radius` [m] is that of a new one, by default 10 % of
        the size of the body.
        """
        if name in self.spheres:
            self.do("move", name, to)
        else:
            self.do("sphere", name, to, self._core.sizes.ball if radius is None else radius, self.contact_stiffness)
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
        if aside:
            begin_aside(self._core, place)
        else:
            self.do("cut", place=place)

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
        command = carried_out(self._core, checked(replace(command, frame=self.log.frames), self.dim))
        if command.kind == "restart":
            self._core.log = self.log.begun_again()
        else:
            self.log.commands.append(command)

    # --- how it moves -------------------------------------------------------------------------------------------

    def step(self, frames: int = 1) -> None:
        """Advance by a number of frames."""
        for _ in range(frames):
            self._cut_what_is_ready()
            if not self._core.advance():
                self._core.note("the motion became unstable: the body begins again")
                self.restart()

    def _cut_what_is_ready(self) -> None:
        """Carry out the cut that another thread has built, if there is one."""
        aside = self._core.aside
        command = aside.ready()
        try:
            if command is not None:
                self.repeat(command)
        except TruespringError as error:  # asked in an earlier frame: nothing that asked it waits for an answer
            self._core.note(str(error))
        finally:
            if command is not None:
                aside.forget()

    def settle(self) -> None:
        """Take gravity as it was asked for, without a frame in which it changes."""
        self._core.settle()

    def choose(self, scheme: str, step: float | str, iterations: int) -> None:
        """Take other steps from now on, see `Settings`."""
        self._core.choose(replace(self.settings, scheme=scheme, step=step, iterations=iterations))

    def go_on(self, state: State, moment: Moment | None = None) -> None:
        """Go on from the state of another session of the body, or with its grasps and spheres from `moment`."""
        self._core.go_on(state, moment)


def replayed(live: Live, commands: Sequence[Command], frames: int) -> Live:
    """Return a session after it was given commands again, each before the frame that it was given before."""
    left = list(commands)
    for frame in range(frames):
        while left and left[0].frame <= frame:
            live.repeat(left.pop(0))
        live.step()
    return live
