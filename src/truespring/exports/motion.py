"""How a body of springs is let loose in a simulator of motion so that it soon rests on its equilibrium.

Equilibria depend neither on masses nor on damping nor on where a body starts, as long as it comes to rest there.
"""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.exports.exported import Exported
from truespring.mesh import element_corner_measures
from truespring.models.spring_data import PlainSprings
from truespring.potential import SparseMatrix

# Where the material has no density [kg/m^3], and of each node of a network without material [kg].
_DENSITY, _NODE_MASS = 1000.0, 1.0
# Simulators take no masses of nothing: MuJoCo none below 1e-15 kg.
_SMALLEST_MASS = 1e-12
# Semi-implicit Euler is stable up to a time step of 2 over the highest frequency; half of that leaves room.
_STEP = 1.0
# Of the highest frequency, where the lowest is not known: no equilibrium was found, or an unstable one.
_GUESSED = 1e-3
# So few unknowns are solved for all their frequencies.
_FEW = 100
# A body has settled within this share of its largest displacement; the simulation goes on to the second.
_SETTLED, _SURELY = 1e-3, 1e-5
# A critically damped oscillation is down to 1e-5 where (1 + w t) exp(-w t) is, at w t = 14.2.
_USUAL = 15.0
# A simulation takes at most so many times as long as that, and so many springs times steps.
_LONGEST, _BUDGET = 20, 10**9
# Nodes that nothing pulls to a support start at rest; the others are pulled so many times more.
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Motion:
    """What a simulator of motion is given, and what it then does.

    Attributes:
        mass: of each node [kg], shape (n_nodes,).
        damping: force over mass and velocity [1/s], on every node.
        time_step: of semi-implicit Euler [s].
        start: where nodes start [m], shape (n_nodes, dim): at rest where no support moves.
        duration: after which it has settled within 0.1 % of the largest displacement [s].
        settles: whether it settles on our equilibrium; None where that was not simulated to its end.
        words: the same in sentences, and what was assumed.
    """

    mass: Floats
    damping: float
    time_step: float
    start: Floats
    duration: float
    settles: bool | None
    words: tuple[str, ...]


def motion_of(exported: Exported, network: PlainSprings) -> Motion:
    """Return masses of the body's density, damping that is critical for its lowest frequency, and how long it takes.

    That is found by the motion itself, under the whole load at once, by semi-implicit Euler with implicit damping.
    """
    mass, assumed = _masses(exported)
    around = np.bincount(network.springs.ravel(), np.repeat(network.stiffness, 2), len(mass))
    free = ~exported.held.all(axis=1)
    # Whatever the positions, a spring's tangent is at most k [[I, -I], [-I, I]]: Gershgorin's circles bound the sum.
    highest = float(np.sqrt((2 * around[free] / mass[free]).max(initial=0.0))) or 1.0
    lowest = _lowest_frequency(exported, network, mass)
    frequency = _GUESSED * highest if lowest is None else lowest
    told = "a guess, for no stable equilibrium is known" if lowest is None else "that of our equilibrium"
    damping, time_step, start = 2 * frequency, _STEP / highest, _start(exported, network)
    usual = int(np.ceil(_USUAL / (frequency * time_step)))
    steps, settles = _settled(exported, network, (mass, damping, time_step, start), usual)
    return Motion(
        mass,
        damping,
        time_step,
        start,
        steps * time_step,
        settles,
        (
            *assumed,
            f"Damping is critical for a lowest frequency of {frequency:.6g} rad/s, {told}.",
            _told(steps, time_step, settles, exported.state is not None),
        ),
    )


def _told(steps: int, time_step: float, settles: bool | None, known: bool) -> str:
    long = f"{steps} steps, {steps * time_step:.4g} s of its own time"
    if settles:
        return f"It settles within 0.1 % of the largest displacement in {long}."
    if not known:
        return f"How long it takes to settle is not known; {long} are a guess."
    if settles is None:
        return f"It should settle within 0.1 % of the largest displacement in {long}; that was not simulated here."
    return (
        f"In {long} it did not settle on the equilibrium given here: under the whole load at once it goes another way. "
        "Put the load on slowly, or start from the equilibrium."
    )


def _masses(exported: Exported) -> tuple[Floats, tuple[str, ...]]:
    """Lumped mass of each node [kg], and what is assumed."""
    problem, mesh = exported.problem, exported.problem.mesh
    words = []
    if not problem.materials:
        mass = np.full(mesh.n_nodes, _NODE_MASS)
        words.append(f"The network tells no mass: {_NODE_MASS:g} kg a node is assumed; the equilibrium is without it.")
    else:
        if any(material.density is None for material in problem.materials):
            words.append(
                f"A density of {_DENSITY:g} kg/m^3 is assumed where none is given; the equilibrium is without it."
            )
        density = problem.of_elements(lambda material: material.density or _DENSITY)
        shares = problem.body.thickness * density[:, None] * element_corner_measures(mesh)
        mass = np.bincount(mesh.elements.ravel(), shares.ravel(), mesh.n_nodes).astype(np.float64)
    if mass.min() < _SMALLEST_MASS:
        factor = _SMALLEST_MASS / mass.min()
        words.append(f"Masses are multiplied by {factor:.3g}, for simulators take no smaller ones.")
        mass = mass * factor
    return mass, tuple(words)


def _lowest_frequency(exported: Exported, network: PlainSprings, mass: Floats) -> float | None:
    """The lowest frequency about our equilibrium [rad/s], None where it is not known."""
    state, free = exported.state, np.flatnonzero(~exported.held.ravel())
    if state is None or state.negative_eigenvalues or not free.size:
        return None
    root = np.sqrt(np.repeat(mass, exported.held.shape[1])[free])
    lowest = _lowest_eigenvalue(network.hessian(state.positions), free, root)
    return float(np.sqrt(lowest)) if lowest > 0 else None


def _lowest_eigenvalue(tangent: SparseMatrix, free: Ints, root: Floats) -> float:
    """Of the tangent of the free directions over the masses whose roots are given [1/s^2]."""
    from scipy import sparse
    from scipy.sparse.linalg import eigsh

    scale = sparse.diags_array(1 / root)
    matrix = sparse.csc_array(scale @ sparse.csr_array(tangent)[free][:, free] @ scale)
    if free.size <= _FEW:
        return float(np.linalg.eigvalsh(matrix.toarray())[0])
    first = np.random.default_rng(free.size).standard_normal(free.size)
    return float(eigsh(matrix, 1, sigma=0.0, v0=first, tol=1e-6, return_eigenvectors=False)[0])


def _start(exported: Exported, network: PlainSprings) -> Floats:
    """Where nodes start [m]: held ones at their places, the others displaced as the mean of their neighbours.

    A body whose supports jump while the rest stands still folds onto itself, and stays so.
    """
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    nodes, held = network.nodes, exported.held
    (first, second), n_nodes = network.springs.T, len(nodes)
    ends = np.concatenate([first, second]), np.concatenate([second, first])
    joined = sparse.csr_array(sparse.coo_array((np.ones(len(ends[0])), ends), shape=(n_nodes, n_nodes)))
    laplacian = sparse.csr_array(sparse.diags_array(joined.sum(axis=1) * (1 + _SLACK)) - joined)
    displacement = exported.motion.copy()
    for axis in np.flatnonzero(displacement.any(axis=0)):
        free = np.flatnonzero(~held[:, axis])
        if free.size:
            pull = -(laplacian[free] @ displacement[:, axis])
            displacement[free, axis] = spsolve(sparse.csc_array(laplacian[free][:, free]), pull)
    return np.asarray(nodes + displacement)


def _settled(
    exported: Exported, network: PlainSprings, motion: tuple[Floats, float, float, Floats], usual: int
) -> tuple[int, bool | None]:
    """The steps to come within 0.1 % of our equilibrium and stay, and whether that is so; by the motion itself."""
    longest = min(_LONGEST * usual, _BUDGET // len(network.springs))
    if exported.state is None or longest < usual:
        return usual, None
    mass, damping, step, start = motion
    goal = exported.state.positions
    largest = float(np.linalg.norm(exported.state.displacement, axis=1).max()) or 1.0
    free = ~exported.held
    force, gain = exported.external_force, np.where(free, step / mass[:, None], 0.0)
    positions, velocity, last = start.copy(), np.zeros(start.shape), 0
    for number in range(1, longest + 1):
        velocity += gain * (force - network.gradient(positions))
        velocity /= 1 + step * damping
        positions += step * velocity
        away = float(np.sqrt(((positions - goal) ** 2).sum(axis=1).max())) / largest
        if away > _SETTLED:
            last = number
        elif away < _SURELY:
            return last + 1 + last // 10, True
    return longest, False if longest == _LONGEST * usual else None
