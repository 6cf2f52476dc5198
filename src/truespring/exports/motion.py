"""Masses, damping and time step with which a dynamic simulation settles quickly at the static equilibrium.

The equilibrium does not depend on masses, damping or initial positions, as long as the motion settles at it.
"""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.exports.exported import Exported
from truespring.mesh import element_corner_measures
from truespring.models.spring_data import PlainSprings
from truespring.potential import SparseMatrix

# Default density [kg/m^3], and mass of each node of a network without material [kg].
_DENSITY, _NODE_MASS = 1000.0, 1.0
# Smallest mass [kg]; MuJoCo rejects masses below 1e-15 kg.
_SMALLEST_MASS = 1e-12
# Time step times highest frequency; semi-implicit Euler is stable up to 2.
_STEP = 1.0
# Lowest over highest frequency, if the lowest is unknown: no equilibrium was found, or it is unstable.
_GUESSED = 1e-3
# Up to this number of unknowns, all frequencies are computed by a dense solver.
_FEW = 100
# Distances from equilibrium over the largest displacement: the body has settled; the simulation ends.
_SETTLED, _SURELY = 1e-3, 1e-5
# w t of a critically damped oscillation, at which (1 + w t) exp(-w t) is below 1e-5.
_USUAL = 15.0
# Limits of a simulation: its duration over the usual one, and springs times steps.
_LONGEST, _BUDGET = 20, 10**9
# Relative stiffness that holds nodes without a path to a support at rest.
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Motion:
    """Parameters of a dynamic simulation, and when it settles.

    Attributes:
        mass: mass of each node [kg], shape (n_nodes,).
        damping: damping force per mass and velocity [1/s], for every node.
        time_step: time step of semi-implicit Euler [s].
        start: initial positions [m], shape (n_nodes, dim); undeformed if no support moves.
        duration: time to settle within 0.1 % of the largest displacement [s].
        settles: whether it settles at the static equilibrium; None if that was not simulated to its end.
        words: these values and the assumptions, in sentences.
    """

    mass: Floats
    damping: float
    time_step: float
    start: Floats
    duration: float
    settles: bool | None
    words: tuple[str, ...]


def motion_of(exported: Exported, network: PlainSprings) -> Motion:
    """Return lumped masses, damping that is critical for the lowest frequency, and the time to settle.

    The time is found by simulation under the full load from the start: semi-implicit Euler with implicit damping.
    """
    mass, assumed = _masses(exported)
    around = np.bincount(network.springs.ravel(), np.repeat(network.stiffness, 2), len(mass))
    free = ~exported.held.all(axis=1)
    # In any position the tangent of a spring is at most k [[I, -I], [-I, I]]; Gershgorin's circles bound the sum.
    highest = float(np.sqrt((2 * around[free] / mass[free]).max(initial=0.0))) or 1.0
    lowest = _lowest_frequency(exported, network, mass)
    frequency = _GUESSED * highest if lowest is None else lowest
    source = "a guess, since no stable equilibrium is known" if lowest is None else "that of the equilibrium"
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
            f"Damping is critical for a lowest frequency of {frequency:.6g} rad/s, {source}.",
            _settling(steps, time_step, settles, exported.state is not None),
        ),
    )


def _settling(steps: int, time_step: float, settles: bool | None, known: bool) -> str:
    """Return the time to settle as a sentence; `known` if the equilibrium is."""
    long = f"{steps} steps, {steps * time_step:.4g} s of simulated time"
    if settles:
        return f"The body settles within 0.1 % of the largest displacement in {long}."
    if not known:
        return f"The time to settle is not known; {long} are a guess."
    if settles is None:
        return f"The body should settle within 0.1 % of the largest displacement in {long}; this was not simulated."
    return (
        f"In {long} the body did not settle at the equilibrium given above: under the full load from the start it "
        "moves to another state. Apply the load slowly, or start from the equilibrium."
    )


def _masses(exported: Exported) -> tuple[Floats, tuple[str, ...]]:
    """Return the lumped mass of each node [kg], shape (n_nodes,), and the assumptions as sentences."""
    problem, mesh = exported.problem, exported.problem.mesh
    words = []
    if not problem.materials:
        mass = np.full(mesh.n_nodes, _NODE_MASS)
        words.append(
            f"The network has no masses: {_NODE_MASS:g} kg per node is assumed; the equilibrium does not depend on it."
        )
    else:
        if any(material.density is None for material in problem.materials):
            words.append(
                f"A density of {_DENSITY:g} kg/m^3 is assumed where none is given; the equilibrium does not depend on "
                "it."
            )
        density = problem.of_elements(lambda material: material.density or _DENSITY)
        shares = problem.body.thickness * density[:, None] * element_corner_measures(mesh)
        mass = np.bincount(mesh.elements.ravel(), shares.ravel(), mesh.n_nodes).astype(np.float64)
    if mass.min() < _SMALLEST_MASS:
        factor = _SMALLEST_MASS / mass.min()
        words.append(f"Masses are multiplied by {factor:.3g}, because simulators reject smaller ones.")
        mass = mass * factor
    return mass, tuple(words)


def _lowest_frequency(exported: Exported, network: PlainSprings, mass: Floats) -> float | None:
    """Return the lowest frequency at the equilibrium [rad/s], None if there is no stable equilibrium."""
    state, free = exported.state, np.flatnonzero(~exported.held.ravel())
    if state is None or state.negative_eigenvalues or not free.size:
        return None
    root = np.sqrt(np.repeat(mass, exported.held.shape[1])[free])
    lowest = _lowest_eigenvalue(network.hessian(state.positions), free, root)
    return float(np.sqrt(lowest)) if lowest > 0 else None


def _lowest_eigenvalue(tangent: SparseMatrix, free: Ints, root: Floats) -> float:
    """Return the lowest eigenvalue of M^-1/2 K M^-1/2 on the free directions [1/s^2]; `root` is M^1/2."""
    from scipy import sparse
    from scipy.sparse.linalg import eigsh

    scale = sparse.diags_array(1 / root)
    matrix = sparse.csc_array(scale @ sparse.csr_array(tangent)[free][:, free] @ scale)
    if free.size <= _FEW:
        return float(np.linalg.eigvalsh(matrix.toarray())[0])
    first = np.random.default_rng(free.size).standard_normal(free.size)
    return float(eigsh(matrix, 1, sigma=0.0, v0=first, tol=1e-6, return_eigenvectors=False)[0])


def _start(exported: Exported, network: PlainSprings) -> Floats:
    """Return the initial positions [m], shape (n_nodes, dim): free nodes move by the mean of their neighbours.

    If supports jumped to their positions while other nodes stood still, the body could fold and stay folded.
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
    """Simulate; return the number of steps to settle within 0.1 % of the equilibrium, and whether it settles."""
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
