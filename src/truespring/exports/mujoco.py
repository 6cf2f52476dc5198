"""Springs for MuJoCo: one MJCF file whose nodes are bodies that slide, its springs spatial tendons.

Form and units: https://mujoco.readthedocs.io/en/stable/XMLreference.html. What MuJoCo does is dynamics: masses,
damping and time step are chosen so that it settles soon on the equilibrium of the dead loads, which do not depend
on them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.exports.exported import Exported, in_space
from truespring.mesh import element_corner_measures
from truespring.mesh.selections import AXES
from truespring.models import SpringNetwork
from truespring.potential import SparseMatrix

# Where the material has no density [kg/m^3], and of each node of a network without material [kg].
_DENSITY, _NODE_MASS = 1000.0, 1.0
# MuJoCo takes no moving body below 1e-15 kg.
_SMALLEST_MASS = 1e-12
# The semi-implicit Euler method is stable up to 2 over the highest frequency; half of that leaves room for damping.
_STEP = 1.0
# A critically damped oscillation is down to 0.1 % where (1 + w t) exp(-w t) = 0.001, at w t = 9.23; on the way
# there the body may be slower than about its equilibrium.
_SETTLED = 15.0
# Of the highest frequency, where the lowest is not known: no equilibrium was found, or an unstable one.
_GUESSED = 1e-3
# So few unknowns are solved for all their frequencies.
_FEW = 100


def mujoco(exported: Exported) -> Mapping[str, str | bytes]:
    """Return springs.xml: MJCF that loads itself and settles on the equilibrium.

    Raises ExportError for volume terms, coupled springs and negative stiffness.
    """
    network = exported.network("MuJoCo", negative=False)
    return {"springs.xml": "\n".join([*_lines(exported, network, _motion(exported, network)), ""])}


@dataclass(frozen=True, eq=False)
class _Motion:
    """What makes a dynamic body settle: mass of each node [kg], rate of damping [1/s], time step and time [s]."""

    mass: Floats
    damping: float
    time_step: float
    settled: float
    words: tuple[str, ...]


def _motion(exported: Exported, network: SpringNetwork) -> _Motion:
    mass, words = _masses(exported)
    around = np.zeros(len(mass))
    for end in network.springs.T:
        np.add.at(around, end, network.stiffness)
    free = ~exported.held.all(axis=1)
    # Whatever the positions, a spring's tangent is at most k [[I, -I], [-I, I]]: Gershgorin's circles bound the sum.
    highest = float(np.sqrt((2 * around[free] / mass[free]).max(initial=np.finfo(float).tiny)))
    lowest = _lowest_frequency(exported, network, mass)
    guessed = lowest is None
    lowest = _GUESSED * highest if lowest is None else lowest
    settled = _SETTLED / lowest
    told = "a guess: no stable equilibrium is known" if guessed else "that of the equilibrium"
    return _Motion(
        mass,
        2 * lowest,
        _STEP / highest,
        settled,
        (
            *words,
            f"Damping is critical for a lowest frequency of {lowest:.6g} rad/s, {told}.",
            f"The body settles within 0.1 % in about {settled:.4g} s of its own time, "
            f"{int(np.ceil(settled * highest / _STEP))} steps.",
        ),
    )


def _masses(exported: Exported) -> tuple[Floats, tuple[str, ...]]:
    """Lumped mass of each node [kg], and what is assumed."""
    problem, mesh = exported.problem, exported.problem.mesh
    words = []
    if not problem.materials:
        mass = np.full(mesh.n_nodes, _NODE_MASS)
        words.append(f"The network has no mass: {_NODE_MASS:g} kg a node is assumed; the equilibrium is without it.")
    else:
        if any(material.density is None for material in problem.materials):
            words.append(f"A density of {_DENSITY:g} kg/m^3 is assumed where none is given; equilibrium is without it.")
        density = problem.of_elements(lambda material: material.density or _DENSITY)
        shares = problem.body.thickness * density[:, None] * element_corner_measures(mesh)
        mass = np.bincount(mesh.elements.ravel(), shares.ravel(), mesh.n_nodes).astype(np.float64)
    if mass.min() < _SMALLEST_MASS:
        factor = _SMALLEST_MASS / mass.min()
        words.append(f"Masses are multiplied by {factor:.3g}: MuJoCo takes none below 1e-15 kg.")
        mass = mass * factor
    return mass, tuple(words)


def _lowest_frequency(exported: Exported, network: SpringNetwork, mass: Floats) -> float | None:
    """The lowest frequency about our equilibrium [rad/s], None where it is not known."""
    state = exported.state
    if state is None or state.negative_eigenvalues:
        return None
    free = np.flatnonzero(~exported.held.ravel())
    if not free.size:
        return None
    root = np.sqrt(np.repeat(mass, exported.held.shape[1])[free])
    lowest = _lowest_eigenvalue(network.hessian(state.positions), free, root)
    return float(np.sqrt(lowest)) if lowest > 0 else None


def _lowest_eigenvalue(tangent: SparseMatrix, free: np.ndarray, root: Floats) -> float:
    """Of the tangent of the free directions over the masses whose roots are given [1/s^2]."""
    from scipy import sparse
    from scipy.sparse.linalg import eigsh

    scale = sparse.diags_array(1 / root)
    matrix = sparse.csc_array(scale @ sparse.csr_array(tangent)[free][:, free] @ scale)
    if free.size <= _FEW:
        return float(np.linalg.eigvalsh(matrix.toarray())[0])
    start = np.random.default_rng(free.size).standard_normal(free.size)
    return float(eigsh(matrix, 1, sigma=0.0, v0=start, tol=1e-6, return_eigenvectors=False)[0])


def _lines(exported: Exported, network: SpringNetwork, motion: _Motion) -> Iterator[str]:
    nodes = in_space(network.nodes + exported.motion)
    length = float(np.median(network.rest_length))
    extent = float(np.ptp(nodes, axis=0).max())
    yield '<mujoco model="truespring">'
    yield "<!--"
    for line in (*exported.header, *_EXPLAINED, *motion.words):
        yield f"  {_comment(line)}"
    yield "-->"
    yield f'<option timestep="{motion.time_step!r}" gravity="0 0 0" integrator="Euler">'
    yield '  <flag contact="disable" energy="enable"/>'
    yield "</option>"
    # MuJoCo's own guess of the memory that a step takes grows with the square of the nodes; it takes 300 bytes a node.
    yield f'<size memory="{16 + len(nodes) // 500}M"/>'
    yield f'<statistic extent="{extent!r}" meansize="{length!r}" center="{_numbers(nodes.mean(axis=0))}"/>'
    looked_on = -90 if exported.problem.mesh.dim == 2 else -20
    yield f'<visual><global azimuth="90" elevation="{looked_on}"/><headlight ambient="0.7 0.7 0.7"/></visual>'
    yield '<asset><texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8" height="48"/></asset>'
    yield f'<custom><numeric name="settled" data="{motion.settled!r}"/></custom>'
    yield "<default>"
    yield f'  <site size="{0.1 * length!r}" rgba="0.2 0.2 0.2 1"/>'
    yield f'  <tendon width="{0.04 * length!r}" rgba="0.12 0.35 0.7 1"/>'
    yield '  <general gaintype="fixed" gainprm="0" biastype="affine"/>'
    yield "</default>"
    yield "<worldbody>"
    for number, (place, held, mass) in enumerate(zip(nodes, exported.held, motion.mass.tolist(), strict=True)):
        yield f'  <body name="n{number}" pos="{_numbers(place)}"><site name="n{number}"/>'
        yield from _slides(number, held, mass, motion.damping)
        yield "  </body>"
    yield "</worldbody>"
    yield "<tendon>"
    springs = zip(network.springs.tolist(), network.stiffness.tolist(), network.rest_length.tolist(), strict=True)
    for number, ((first, second), stiffness, rest) in enumerate(springs):
        yield f'  <spatial name="s{number}" stiffness="{stiffness!r}" springlength="{rest!r}">'
        yield f'    <site site="n{first}"/><site site="n{second}"/>'
        yield "  </spatial>"
    yield "</tendon>"
    yield "<actuator>"
    for node, axis in np.argwhere((exported.external_force != 0) & ~exported.held).tolist():
        joint, force = f"n{node}{AXES[axis]}", float(exported.external_force[node, axis])
        yield f'  <general name="{joint}" joint="{joint}" biasprm="{force!r} 0 0"/>'
    yield "</actuator>"
    yield "</mujoco>"


_EXPLAINED = (
    "Node i is body and site n<i>, spring j is tendon s<j>, both counted from 0 as in the study.",
    "A body slides along x, y, z where its node is free, and stands where a support moves it where it is not.",
    "Forces on nodes are actuators of constant force; gravity is off, weights are among these forces.",
    "The body starts at rest, with its supports moved, under the whole load at once: one that may buckle or snap "
    "can settle on another equilibrium.",
)


def _slides(number: int, held: np.ndarray, mass: float, damping: float) -> Iterator[str]:
    """The directions in which a node is free; a node without any belongs to the world and has no mass."""
    if held.all():
        return
    for axis in np.flatnonzero(~held):
        direction = " ".join("1" if other == axis else "0" for other in range(3))
        name = f"n{number}{AXES[axis]}"
        yield f'    <joint name="{name}" type="slide" axis="{direction}" damping="{damping * mass!r}"/>'
    # A body that only slides does not turn: its moments of inertia are there because MuJoCo asks for them.
    yield f'    <inertial pos="0 0 0" mass="{mass!r}" diaginertia="{mass!r} {mass!r} {mass!r}"/>'


def _numbers(values: Floats) -> str:
    return " ".join(repr(value) for value in values.tolist())


def _comment(line: str) -> str:
    """XML's comments hold no two hyphens in a row, nor one at their end."""
    return line.replace("--", "- -").removesuffix("-")
