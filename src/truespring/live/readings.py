"""What a session is at present."""

from collections.abc import Mapping, Sequence

from truespring.arrays import Floats, Ints
from truespring.dynamics import Energies
from truespring.live.actions import Ball, Grip
from truespring.live.commands import Log
from truespring.live.core import Core
from truespring.live.mover import kinetic
from truespring.live.settings import Begun, Settings
from truespring.live.state import State
from truespring.loading import Body as LoadedBody
from truespring.models import Model
from truespring.motion.moving import Body
from truespring.motion.stages import Moment
from truespring.problem import Problem
from truespring.solvers import Geometry


class Readings:
    """The state of a session, read; nothing here changes it.

    Attributes:
        notes: what was assumed, and what happened, in sentences.
    """

    def __init__(self, core: Core) -> None:
        """Take the state that is read."""
        self._core = core
        self.notes: list[str] = core.notes

    # --- what it was begun with, and what was asked -------------------------------------------------------------

    @property
    def problem(self) -> Problem:
        """The problem, completed: a body without `dynamics` begins at its equilibrium; water's density by default."""
        return self._core.problem

    @property
    def model(self) -> Model:
        """The model."""
        return self._core.model

    @property
    def models(self) -> Mapping[str, Model]:
        """The models to which the command "model" changes, by name."""
        return self._core.left.models

    @property
    def settings(self) -> Settings:
        """How steps are taken."""
        return self._core.settings

    @property
    def why(self) -> str:
        """Why "auto" chose the scheme, in a sentence; "" if a scheme was given."""
        return self._core.why

    @property
    def log(self) -> Log:
        """The commands since the begin."""
        return self._core.log

    @property
    def begun(self) -> Begun:
        """What the session begins with."""
        return self._core.begun

    @property
    def gravity_share(self) -> float:
        """What gravity is multiplied by, see `gravity`."""
        return self._core.share

    @property
    def full_gravity(self) -> Floats:
        """The acceleration of gravity at share 1 [m/s^2], shape (dim,)."""
        return self._core.gravity.acceleration

    @property
    def is_cutting(self) -> bool:
        """Whether a cut is built in another thread."""
        return self._core.aside.command is not None

    @property
    def nodes_left(self) -> Ints:
        """Numbers in the uncut body of the nodes of the mesh, ascending, shape (n_nodes,)."""
        return self._core.left.nodes

    @property
    def elements_left(self) -> Ints:
        """Numbers in the uncut body of the elements of the mesh, ascending, shape (n_elements,)."""
        return self._core.left.elements

    # --- where it is --------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """The time [s]."""
        return self.moment.time

    @property
    def positions(self) -> Floats:
        """Positions of the nodes of the mesh [m], shape (n_nodes, dim); a copy."""
        return self.moment.positions[: self.problem.mesh.n_nodes].copy()

    @property
    def velocities(self) -> Floats:
        """Velocities of the nodes of the mesh [m/s], shape (n_nodes, dim); a copy."""
        return self.moment.velocity[: self.problem.mesh.n_nodes].copy()

    @property
    def moment(self) -> Moment:
        """The state, with the further nodes of second-order elements."""
        return self._core.moment

    @property
    def state(self) -> State:
        """The state with all that holds the body, for another session."""
        held, weight = self._core.held, self._core.weight
        several = dict(held.grips), dict(held.balls), dict(held.targets)
        gravity = weight.begin, weight.end
        return State(self.log.frames, self.moment, *several, gravity, self._core.mover.stepper.before)

    @property
    def grasps(self) -> Mapping[str, Grip]:
        """Grasps and pins by name."""
        return self._core.held.grips

    @property
    def spheres(self) -> Mapping[str, Ball]:
        """Spheres by name."""
        return self._core.held.balls

    @property
    def forces(self) -> dict[str, Floats]:
        """Force of the body on each grasp and sphere at the end of the last frame [N], shape (dim,), by name."""
        held = self._core.held
        return {name: held.forces[name] for name in held.names if name in held.forces}

    def energies(self) -> Energies:
        """Return the energies; work and dissipation are those of the last frame."""
        body, moment, (done, damped) = self.body, self.moment, self._core.work
        stored = self._core.acting.stored(moment.positions)
        return Energies(kinetic(body, moment), body.potential.energy(moment.positions), -done, stored, damped, 0.0)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What should not be trusted in the present state."""
        ratio = self.problem.mesh.smallest_area_ratio(self.positions)
        return () if ratio > 0 else (f"inverted: the smallest corner Jacobian is {ratio:.2g} of that at rest",)

    # --- its steps ----------------------------------------------------------------------------------------------

    @property
    def scheme(self) -> str:
        """How steps are taken, in words."""
        return self._core.mover.stepper.name

    @property
    def steps_a_frame(self) -> int:
        """The number of steps of a frame."""
        return self._core.mover.steps_a_frame

    @property
    def step_length(self) -> float:
        """The time step [s]."""
        return self._core.mover.step_length

    @property
    def halved(self) -> bool:
        """Whether the step was halved because energy rose without work."""
        return self._core.mover.halvings > 0

    # --- the body and its sizes ---------------------------------------------------------------------------------

    @property
    def body(self) -> Body:
        """What moves, under the present gravity."""
        return self._core.body

    @property
    def geometry(self) -> Geometry:
        """Functions of the mesh for solvers."""
        return self._core.built.geometry

    @property
    def dim(self) -> int:
        """Number of directions."""
        return self.problem.mesh.dim

    @property
    def surface(self) -> tuple[Ints, Floats]:
        """Nodes of the surface, and their shares of its undeformed area [m^2], shape (n,) each.

        Of a network of springs, which has no surface, all nodes without area.
        """
        return self._core.sizes.surface

    @property
    def touched(self) -> tuple[Ints, Floats]:
        """As `surface`, with the further nodes of second-order elements: what spheres push."""
        return self._core.sizes.touched

    @property
    def acted_on(self) -> LoadedBody:
        """The body that grasps and spheres act on, with the further nodes of second-order elements."""
        return self._core.sizes.acted_on

    @property
    def edge(self) -> float:
        """A typical edge of an element [m]."""
        return self._core.sizes.edge

    @property
    def size(self) -> float:
        """The diagonal of the undeformed body's bounding box [m]."""
        return self._core.sizes.size

    @property
    def patch(self) -> float:
        """The radius of a grasp by default [m]."""
        return self._core.sizes.patch

    @property
    def contact_stiffness(self) -> float:
        """The pressure per depth of a sphere [Pa/m]: that which does not shorten the step much."""
        return self._core.sizes.contact_stiffness

    def node_at(self, point: int | Sequence[float]) -> int:
        """Return the number of the node of the surface that is nearest to a place on the body as it is now [m]."""
        return self._core.sizes.node_at(point, self.moment.positions)
