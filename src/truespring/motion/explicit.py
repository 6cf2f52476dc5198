"""The explicit scheme: leapfrog, or velocity Verlet, and its largest stable step."""

from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.conditions import Loading
from truespring.motion.advance import Advance
from truespring.motion.moving import Body
from truespring.motion.record import Account
from truespring.motion.stages import History, Moment
from truespring.solvers.balance import Equilibrium, Reporter

# Share of the largest stable step at rest that is taken: a deformed body is stiffer.
SAFE = 0.5


def stable_step(body: Body) -> float:
    """Return the largest stable step of leapfrog for small motion about the undeformed body [s].

    2 / omega of the highest frequency omega, shortened by the dashpots of the material, whose damping ratio there is
    xi = tau omega / 2, to 2 / omega (sqrt(1 + xi^2) - xi) (Belytschko, Liu, Moran, Nonlinear Finite Elements, 6.2).
    Zero with barriers, which have no largest stiffness. Friction does not shorten it.
    """
    from scipy.sparse.linalg import ArpackNoConvergence, eigsh

    nodes, touched = body.potential.nodes, body.loading.largest_stiffness()
    if not np.isfinite(touched).all():
        return 0.0
    matrix = sparse.csr_array(body.potential.hessian(nodes))
    matrix = matrix + sparse.diags_array(np.repeat(touched, nodes.shape[1]))
    inverse = np.where(body.held, 0.0, 1 / np.sqrt(body.mass)[:, None]).ravel()
    scaled = sparse.csr_array(sparse.diags_array(inverse) @ matrix @ sparse.diags_array(inverse))
    free = np.flatnonzero(~body.held.ravel())
    if len(free) < 3:  # too few for an iteration
        largest = float(np.linalg.eigvalsh(scaled.toarray()).max(initial=0.0))
    else:
        start = np.random.default_rng(1).normal(size=scaled.shape[0])
        try:
            largest = float(eigsh(scaled, k=1, which="LA", v0=start, tol=1e-3, return_eigenvectors=False)[0])
        except ArpackNoConvergence as error:
            largest = float(max(error.eigenvalues, default=abs(scaled).sum(axis=1).max()))
    omega = float(np.sqrt(max(largest, 0.0)))
    if not omega:
        return np.inf
    xi = body.damping.stiffness * omega / 2
    return 2 / omega * float(np.sqrt(1 + xi**2) - xi)


@dataclass
class _Rubbed:
    """Friction in a part of a step.

    Attributes:
        plain: the loading without it.
        h: the time [s].
        forces: force on the nodes by each tool [N], shape (n_nodes, dim).
        velocities: velocity of each tool [m/s], shape (dim,).
    """

    plain: Loading
    h: float
    forces: list[Floats] = field(default_factory=list)
    velocities: list[Floats] = field(default_factory=list)

    def dissipated(self, velocity: Floats) -> float:
        """Return the work against friction [J] at a velocity of the nodes [m/s], shape (n_nodes, dim)."""
        several = zip(self.forces, self.velocities, strict=True)
        return -self.h * sum(float((force * (velocity - of_tool)).sum()) for force, of_tool in several)

    @property
    def loading(self) -> Loading:
        """The loading with the friction."""
        if not self.forces:
            return self.plain
        several = zip(self.plain.interactions, self.forces, strict=True)
        return replace(self.plain, interactions=tuple(one.rubbed(force) for one, force in several))


class Leapfrog:
    """Steps of the leapfrog scheme, with half a kick at both ends: order 2, symmetric in time.

    Friction takes from the tangential velocity of a node what its limit allows, at most all: without regularisation,
    a node that sticks is at rest.
    """

    def __init__(self, body: Body, report: Reporter | None = None) -> None:
        """Store the body, and a function that is called after each step as after an iteration."""
        self.body, self._report = body, report
        self._force: Floats | None = None

    def forget(self) -> None:
        """Forget the force at the end of the last step: the next one begins at another state."""
        self._force = None

    def ready(self, moment: Moment) -> None:
        """Compute the force at the begin of a step, under the present loading, unless the last step left it."""
        if self._force is None:
            self._force = self._forces(moment.positions, moment.time / self.body.duration)

    def advance(self, history: History, h: float, account: Account) -> Advance:
        """Return the step of length h [s] with the work in it."""
        body, last, alpha, account = self.body, history.last, self.body.damping.mass, copy(account)
        levels = last.time / body.duration, (last.time + h) / body.duration
        mass, held = body.mass[:, None], body.held
        self.ready(last)
        assert self._force is not None
        half = last.velocity + h / 2 * (self._force / mass - alpha * last.velocity)
        half, rubbed = self._rubbed(half, last.positions, levels[0], h / 2)
        account.damped += rubbed.dissipated(half)
        positions = body.placed(last.positions + h * half, levels[1])
        moved = positions - last.positions
        half = np.where(held, moved / h, half)
        force = self._forces(positions, levels[1])
        if body.damper is not None:
            before = body.damper.measure(last.positions)
            for one in body.damper.since(before, body.damping.stiffness / h):
                drag = one.gradient(positions)
                force = force - drag
                account.damped += float((drag * moved).sum())
        velocity = np.where(held, half, (half + h / 2 * force / mass) / (1 + h / 2 * alpha))
        velocity, rubbed = self._rubbed(velocity, positions, levels[1], h / 2)
        account.damped += rubbed.dissipated(half)
        loading = rubbed.loading
        account.step(loading, last.positions, positions, levels[1])
        inertia = mass * (velocity - last.velocity) / h
        reaction = np.where(held, inertia - (self._force + force) / 2, 0.0)
        if alpha:
            reaction = reaction + np.where(held, alpha * mass * half, 0.0)
            account.damped += alpha * float((mass * half * moved).sum())
        account.support(reaction, moved)
        self._force = force
        if self._report:
            self._report(levels[1], 0, 0.0)
        moment, still = Moment(last.time + h, positions, velocity), np.zeros_like(positions)
        state = Equilibrium(levels[1], positions, reaction, still, 0.0, 0, 0.0, converged=True)
        return Advance(moment, state, loading, np.where(held, 0.0, force / mass), account, 0)

    def _rubbed(self, velocity: Floats, positions: Floats, level: float, h: float) -> tuple[Floats, "_Rubbed"]:
        """Return the velocity after the friction of a time h [s], and that friction.

        `velocity` [m/s] and `positions` [m] have shape (n_nodes, dim).
        """
        body, loading = self.body, self.body.loading
        found = _Rubbed(loading, h)
        if not loading.dissipates:
            return velocity, found
        velocity = velocity.copy()
        for one in loading.interactions:
            slide = one.slide(positions, level)
            slip = velocity[slide.nodes] - slide.velocity
            slip -= (slip * slide.normals).sum(axis=1)[:, None] * slide.normals
            slip[body.held[slide.nodes]] = 0.0
            size = np.linalg.norm(slip, axis=1)
            mass = body.mass[slide.nodes]
            change = -(np.minimum(1.0, h * slide.limit / (mass * np.where(size > 0, size, np.inf))))[:, None] * slip
            velocity[slide.nodes] += change
            force = np.zeros_like(velocity)
            force[slide.nodes] = mass[:, None] * change / h
            found.forces.append(force)
            found.velocities.append(slide.velocity)
        return velocity, found

    def _forces(self, positions: Floats, level: float) -> Floats:
        """Return loads minus internal force [N], shape (n_nodes, dim)."""
        return self.body.loading.force(positions, level) - self.body.potential.gradient(positions)
