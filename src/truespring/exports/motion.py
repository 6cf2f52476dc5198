"""Masses, damping and time step with which a dynamic simulation settles quickly at the static equilibrium.

The equilibrium does not depend on masses, damping or initial positions, as long as the motion settles at it.
"""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from truespring.arrays import Floats
from truespring.equilibrium import Solution
from truespring.exports.exported import Exported
from truespring.exports.frequencies import highest_frequency, lowest_frequency
from truespring.exports.whole import Whole, all_nodes

# Default density [kg/m^3], and mass of each node of a network without material [kg].
_DENSITY, _NODE_MASS = 1000.0, 1.0
# Smallest mass [kg]; MuJoCo rejects masses below 1e-15 kg.
_SMALLEST_MASS = 1e-12
# Time step times highest frequency; semi-implicit Euler is stable up to 2.
_STEP = 1.0
# Times that the time step is halved if the motion is unstable.
_HALVINGS = 3
# Lowest over highest frequency, if the lowest is unknown: no equilibrium was found, or it is unstable.
_GUESSED = 1e-3
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


_KNOWN: WeakKeyDictionary[Solution, Motion] = WeakKeyDictionary()


def motion_of(exported: Exported) -> Motion:
    """Return lumped masses, damping that is critical for the lowest frequency, and the time to settle.

    The time is found by simulation under the full load from the start: semi-implicit Euler with implicit damping. The
    result is kept as long as the solution, for other targets.
    """
    if exported.path not in _KNOWN:
        _KNOWN[exported.path] = _motion(exported)
    return _KNOWN[exported.path]


def _motion(exported: Exported) -> Motion:
    whole = all_nodes(exported)
    mass, assumed = masses(whole)
    start = _start(whole)
    highest = highest_frequency(whole, mass, start)
    lowest = lowest_frequency(whole, mass)
    frequency = _GUESSED * highest if lowest is None else lowest
    source = "a guess, since no stable equilibrium is known" if lowest is None else "that of the equilibrium"
    damping, time_step = 2 * frequency, _STEP / highest
    for _ in range(_HALVINGS + 1):
        usual = int(np.ceil(_USUAL / (frequency * time_step)))
        steps, settles, stable = _settled(whole, (mass, damping, time_step, start), usual)
        if stable:
            break
        time_step /= 2
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


def masses(whole: Whole) -> tuple[Floats, tuple[str, ...]]:
    """Return the lumped mass of each node [kg], shape (n_nodes,), and the assumptions as sentences."""
    problem, words = whole.exported.problem, []
    if not problem.materials:
        mass = np.full(len(whole.nodes), _NODE_MASS)
        words.append(
            f"The network has no masses: {_NODE_MASS:g} kg per node is assumed; the equilibrium does not depend on it."
        )
    else:
        if any(material.density is None for material in problem.materials):
            words.append(
                f"A density of {_DENSITY:g} kg/m^3 is assumed where none is given; the equilibrium does not depend on "
                "it."
            )
        mass = whole.lumped_mass(problem.of_elements(lambda material: material.density or _DENSITY))
    if mass.min() < _SMALLEST_MASS:
        factor = _SMALLEST_MASS / mass.min()
        words.append(f"Masses are multiplied by {factor:.3g}, because simulators reject smaller ones.")
        mass = mass * factor
    return mass, tuple(words)


def _start(whole: Whole) -> Floats:
    """Return the initial positions [m], shape (n_nodes, dim): free nodes move by the mean of their neighbours.

    If supports jumped to their positions while other nodes stood still, the body could fold and stay folded.
    """
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    nodes, held = whole.nodes, whole.held
    (first, second), n_nodes = whole.springs.T, len(nodes)
    ends = np.concatenate([first, second]), np.concatenate([second, first])
    joined = sparse.csr_array(sparse.coo_array((np.ones(len(ends[0])), ends), shape=(n_nodes, n_nodes)))
    laplacian = sparse.csr_array(sparse.diags_array(joined.sum(axis=1) * (1 + _SLACK)) - joined)
    displacement = whole.motion.copy()
    for axis in np.flatnonzero(displacement.any(axis=0)):
        free = np.flatnonzero(~held[:, axis])
        if free.size:
            pull = -(laplacian[free] @ displacement[:, axis])
            displacement[free, axis] = spsolve(sparse.csc_array(laplacian[free][:, free]), pull)
    return np.asarray(nodes + displacement)


def _settled(whole: Whole, motion: tuple[Floats, float, float, Floats], usual: int) -> tuple[int, bool | None, bool]:
    """Simulate the motion.

    Returns the number of steps to settle within 0.1 % of the equilibrium, whether it settles, and whether it is stable.
    """
    longest, goal = min(_LONGEST * usual, _BUDGET // len(whole.springs)), whole.positions
    if goal is None or longest < usual:
        return usual, None, True
    mass, damping, step, start = motion
    largest = float(np.linalg.norm(goal - whole.nodes, axis=1).max()) or 1.0
    force, gain = whole.force, np.where(~whole.held, step / mass[:, None], 0.0)
    positions, velocity, last = start.copy(), np.zeros(start.shape), 0
    for number in range(1, longest + 1):
        velocity += gain * (force - whole.potential.gradient(positions))
        velocity /= 1 + step * damping
        positions += step * velocity
        away = float(np.sqrt(((positions - goal) ** 2).sum(axis=1).max())) / largest
        if not np.isfinite(away):
            return usual, False, False
        if away > _SETTLED:
            last = number
        elif away < _SURELY:
            return last + 1 + last // 10, True, True
    return longest, False if longest == _LONGEST * usual else None, True
