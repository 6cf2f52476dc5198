"""MuJoCo MJCF files: nodes are bodies on slide joints, springs are spatial tendons.

Source: https://mujoco.readthedocs.io/en/stable/XMLreference.html
"""

import re
from collections.abc import Iterator, Mapping

import numpy as np

from truespring.arrays import Bools, Floats, in_space
from truespring.exports.exported import Exported
from truespring.exports.motion import Motion, motion_of
from truespring.mesh.selections import AXES
from truespring.models.spring_data import PlainSprings


def mujoco(exported: Exported) -> Mapping[str, str | bytes]:
    """Return springs.xml, an MJCF file with the loads; the simulation settles at the equilibrium."""
    network = exported.network
    return {"springs.xml": "\n".join([*_lines(exported, network, motion_of(exported, network)), ""])}


def _lines(exported: Exported, network: PlainSprings, motion: Motion) -> Iterator[str]:
    nodes = in_space(motion.start)
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
    # MuJoCo's default memory grows with the square of the number of nodes; a step needs 300 bytes per node.
    yield f'<size memory="{16 + len(nodes) // 500}M"/>'
    yield f'<statistic extent="{extent!r}" meansize="{length!r}" center="{_numbers(nodes.mean(axis=0))}"/>'
    looked_on = -90 if exported.problem.mesh.dim == 2 else -20
    yield f'<visual><global azimuth="90" elevation="{looked_on}"/><headlight ambient="0.7 0.7 0.7"/></visual>'
    yield '<asset><texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8" height="48"/></asset>'
    yield f'<custom><numeric name="settled" data="{motion.duration!r}"/></custom>'
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
    if exported.state is not None and not exported.held.all():
        away = (exported.state.positions - motion.start)[~exported.held]
        yield f'<keyframe><key name="equilibrium" qpos="{_numbers(away)}"/></keyframe>'
    yield "</mujoco>"


_EXPLAINED = (
    "Node i is body and site n<i>, spring j is tendon s<j>, both counted from 0 as in the study.",
    "Each body has slide joints in the free directions of its node; in the others it is fixed at its final position.",
    "Nodal forces are actuators of constant force; gravity is off, weight is included in these forces.",
    "The full load acts from the start. Supports that move start at their final positions, other nodes are displaced "
    "by the mean of their neighbours. The keyframe 'equilibrium' is the state given above.",
)


def _slides(number: int, held: Bools, mass: float, damping: float) -> Iterator[str]:
    """Yield the slide joints and mass of a node; a node without free directions is fixed to the world, without mass."""
    if held.all():
        return
    for axis in np.flatnonzero(~held):
        direction = " ".join("1" if other == axis else "0" for other in range(3))
        name = f"n{number}{AXES[axis]}"
        yield f'    <joint name="{name}" type="slide" axis="{direction}" damping="{damping * mass!r}"/>'
    # A body on slide joints does not rotate; MuJoCo requires moments of inertia nevertheless.
    yield f'    <inertial pos="0 0 0" mass="{mass!r}" diaginertia="{mass!r} {mass!r} {mass!r}"/>'


def _numbers(values: Floats) -> str:
    return " ".join(repr(value) for value in values.tolist())


def _comment(line: str) -> str:
    """Return a line with "--" separated, which XML comments must not contain."""
    return re.sub("-(?=-)", "- ", line)
