"""MuJoCo: nodes are bodies on slide joints; springs are spatial tendons, or forces of a Python driver.

Source: https://mujoco.readthedocs.io/en/stable/XMLreference.html
"""

from collections.abc import Iterator, Mapping
from typing import Any

from truespring.exports.arrays import npz
from truespring.exports.exported import Exported
from truespring.exports.features import Feature, features
from truespring.exports.forces import NAME, spring_forces
from truespring.exports.mjcf import Scene, flex_lines, scene_lines
from truespring.exports.motion import motion_of
from truespring.exports.scripts import script
from truespring.exports.surfaces import is_surface, surface_of
from truespring.exports.tetrahedra import flex_scene, flex_values
from truespring.exports.whole import all_nodes
from truespring.models.spring_data import PlainSprings

#: Features of springs and loads that tendons have.
_IN_TENDONS = frozenset({Feature.PRESTRESS, Feature.FOLLOWING})


def mujoco(exported: Exported) -> Mapping[str, str | bytes]:
    """Return springs.xml, an MJCF file with the loads; the simulation settles at the equilibrium.

    If tendons do not express the springs, also a driver that adds their forces, its module and data, and flex.xml, the
    body as MuJoCo's own finite elements where it has these.
    """
    whole, contact = all_nodes(exported), bool(exported.options.get("contact", False))
    driven = _is_driven(exported)
    surface = surface_of(whole)
    scene = Scene(exported, whole, motion_of(exported), contact, (driven or contact) and is_surface(surface))
    flex = list(flex_lines(scene, "surface", surface)) if scene.flex else []
    if not driven:
        return {"springs.xml": scene_lines(scene, (*_EXPLAINED, _TENDONS), [*flex, *_tendons(exported.network)])}
    return {
        "springs.xml": scene_lines(scene, (*_EXPLAINED, _DRIVEN), flex),
        "drive.py": script("mujoco_drive", exported),
        NAME: spring_forces(),
        **npz(exported),
        **flex_scene(scene),
    }


def mujoco_values(exported: Exported) -> Mapping[str, Any]:
    """Return what exported.json states of flex.xml."""
    return flex_values(exported) if _is_driven(exported) else {}


def _is_driven(exported: Exported) -> bool:
    """Return whether tendons do not express the springs."""
    return bool({feature for feature, _ in features(exported.problem, exported.springs)} - _IN_TENDONS)


def _tendons(network: PlainSprings) -> Iterator[str]:
    yield "<tendon>"
    springs = zip(network.springs.tolist(), network.stiffness.tolist(), network.rest_length.tolist(), strict=True)
    for number, ((first, second), stiffness, rest) in enumerate(springs):
        yield f'  <spatial name="s{number}" stiffness="{stiffness!r}" springlength="{rest!r}">'
        yield f'    <site site="n{first}"/><site site="n{second}"/>'
        yield "  </spatial>"
    yield "</tendon>"


_EXPLAINED = (
    "Node i is body and site n<i>, counted from 0 as in the study; nodes on edges of elements of second order follow.",
    "Each body has slide joints in the free directions of its node; in the others it is fixed at its final position.",
    "Nodal forces are actuators of constant force; gravity is off, weight is included in these forces.",
    "The full load acts from the start. Supports that move start at their final positions, other nodes are displaced "
    "by the mean of their neighbours. The keyframe 'equilibrium' is the state given above.",
)
_TENDONS = "Spring j is tendon s<j>, counted from 0 as in the study."
_DRIVEN = (
    "THIS FILE HAS NO SPRINGS: drive.py adds their forces and those of the elements in each step (mjcb_passive). Run "
    "it by: python drive.py"
)
