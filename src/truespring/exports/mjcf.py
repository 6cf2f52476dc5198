"""MJCF files of bodies on slide joints with loads, for MuJoCo."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truespring.arrays import Bools, Floats, in_space
from truespring.exports.exported import Exported
from truespring.exports.motion import Motion
from truespring.exports.surfaces import Cells
from truespring.exports.whole import Whole
from truespring.mesh.selections import AXES

# Distance from the surface at which contacts begin, over the median length of springs.
_RADIUS = 0.02
# Damping of the edges of a flex over that of the joints of its lightest body.
_DAMPING = 1e-9


@dataclass(frozen=True, eq=False)
class Scene:
    """What a file consists of beside springs.

    Attributes:
        exported: the study with its equilibrium.
        whole: all nodes.
        motion: masses, damping, time step and initial positions.
        contact: whether contacts are enabled.
        flex: whether the bodies are corners of a flex. MuJoCo allows no damping of their joints: actuators damp them.
    """

    exported: Exported
    whole: Whole
    motion: Motion
    contact: bool
    flex: bool

    @cached_property
    def length(self) -> float:
        """The median distance of the ends of the springs at the start [m]."""
        springs = self.whole.springs
        some = springs[springs.max(axis=1) < len(self.motion.start)]
        return float(np.median(np.linalg.norm(np.diff(self.motion.start[some], axis=1)[:, 0], axis=1)))

    @property
    def radius(self) -> float:
        """The distance from the surface at which contacts begin [m]."""
        return _RADIUS * self.length


def scene_lines(scene: Scene, explained: Iterable[str], own: Iterable[str]) -> str:
    """Return an MJCF file; `own` are the lines of springs and elements."""
    return "\n".join([*_lines(scene, explained, own), ""])


def _lines(scene: Scene, explained: Iterable[str], own: Iterable[str]) -> Iterator[str]:
    exported, motion, length = scene.exported, scene.motion, scene.length
    nodes, held = in_space(motion.start), scene.whole.held
    extent = float(np.ptp(nodes, axis=0).max())
    yield '<mujoco model="truespring">'
    yield "<!--"
    for line in (*exported.header, *explained, *motion.words):
        yield f"  {_comment(line)}"
    yield "-->"
    yield f'<option timestep="{motion.time_step!r}" gravity="0 0 0" integrator="Euler">'
    yield f'  <flag contact="{"enable" if scene.contact else "disable"}" energy="enable"/>'
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
    for number, (place, fixed, mass) in enumerate(zip(nodes, held, motion.mass.tolist(), strict=True)):
        yield f'  <body name="n{number}" pos="{_numbers(place)}"><site name="n{number}"/>'
        yield from _slides(number, fixed, mass, 0.0 if scene.flex else motion.damping)
        yield "  </body>"
    yield "</worldbody>"
    yield from own
    yield "<actuator>"
    for node, axis in np.argwhere(((scene.whole.force != 0) | scene.flex) & ~held).tolist():
        joint, force = f"n{node}{AXES[axis]}", float(scene.whole.force[node, axis])
        drag = f"{-motion.damping * float(motion.mass[node])!r}" if scene.flex else "0"
        yield f'  <general name="{joint}" joint="{joint}" biasprm="{force!r} 0 {drag}"/>'
    yield "</actuator>"
    if scene.whole.positions is not None and not held.all():
        away = (scene.whole.positions - motion.start)[~held]
        yield f'<keyframe><key name="equilibrium" qpos="{_numbers(away)}"/></keyframe>'
    yield "</mujoco>"


def _slides(number: int, held: Bools, mass: float, damping: float) -> Iterator[str]:
    """Yield the slide joints and mass of a node; a node without free directions is fixed to the world, without mass."""
    if held.all():
        return
    for axis in np.flatnonzero(~held):
        direction = " ".join("1" if other == axis else "0" for other in range(3))
        name = f"n{number}{AXES[axis]}"
        damped = f' damping="{damping * mass!r}"' if damping else ""
        yield f'    <joint name="{name}" type="slide" axis="{direction}"{damped}/>'
    # A body on slide joints does not rotate; MuJoCo requires moments of inertia nevertheless.
    yield f'    <inertial pos="0 0 0" mass="{mass!r}" diaginertia="{mass!r} {mass!r} {mass!r}"/>'


def flex_lines(scene: Scene, name: str, cells: Cells, elasticity: str = "") -> Iterator[str]:
    """Yield triangles or tetrahedra whose corners are the bodies, without forces of their own except `elasticity`.

    A negligible damping of edges keeps MuJoCo from warning that the flex has no forces.
    """
    damping = _DAMPING * scene.motion.damping * float(scene.motion.mass.min())
    bodies = " ".join(f"n{node}" for node in cells.nodes.tolist())
    elements = " ".join(map(str, cells.cells.ravel().tolist()))
    way = int(scene.contact)
    yield "<deformable>"
    yield f'  <flex name="{name}" dim="{cells.cells.shape[1] - 1}" radius="{scene.radius!r}" rgba="0.75 0.45 0.4 1"'
    yield f'    body="{bodies}"'
    yield f'    element="{elements}">'
    yield f'    <contact contype="{way}" conaffinity="{way}" selfcollide="none"/>'
    yield f'    <edge damping="{damping!r}"/>'
    if elasticity:
        yield f"    {elasticity}"
    yield "  </flex>"
    yield "</deformable>"


def _numbers(values: Floats) -> str:
    return " ".join(repr(value) for value in values.tolist())


def _comment(line: str) -> str:
    """Return a line with "--" separated, which XML comments must not contain."""
    return re.sub("-(?=-)", "- ", line)
