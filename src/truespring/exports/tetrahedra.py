"""The body as MuJoCo's own finite elements beside springs: an approximation with another law."""

from collections.abc import Mapping
from dataclasses import replace

from truespring.errors import MeshError
from truespring.exports.mjcf import Scene, flex_lines, scene_lines
from truespring.exports.motion import masses
from truespring.exports.surfaces import cells_of
from truespring.exports.whole import nodes_of_the_mesh
from truespring.mesh import in_simplices

# The time step over that of the springs: the tetrahedra of a cube are stiffer than its springs.
_STEP = 0.25


def flex_scene(scene: Scene) -> Mapping[str, str]:
    """Return flex.xml: triangles or tetrahedra of first order with MuJoCo's elasticity; nothing where it has none.

    Bodies without elements and those whose supports move are left out: MuJoCo takes the initial positions as
    undeformed. So are those of several materials, and elements that cannot be divided.
    """
    exported = scene.exported
    if len(exported.problem.materials) != 1 or scene.whole.motion.any() or exported.section == "plane strain":
        return {}
    try:
        divided, _ = in_simplices(exported.problem.mesh)
    except MeshError:
        return {}
    (material,), problem = exported.problem.materials, exported.problem
    whole = nodes_of_the_mesh(exported)
    motion = replace(
        scene.motion,
        time_step=_STEP * scene.motion.time_step,
        start=whole.nodes,
        mass=masses(whole)[0],
        words=("Damping is that of springs.xml; its time step is divided by four.",),
    )
    elasticity = f'<elasticity young="{material.young!r}" poisson="{material.poisson!r}"'
    if problem.mesh.dim == 2:
        assert problem.section is not None  # see require_body
        elasticity += f' thickness="{problem.section.thickness!r}" elastic2d="stretch"'
    flat = replace(scene, whole=whole, motion=motion, flex=True)
    own = flex_lines(flat, "body", cells_of(divided.elements), f"{elasticity}/>")
    return {"flex.xml": scene_lines(flat, _EXPLAINED, own)}


_EXPLAINED = (
    "AN APPROXIMATION, not the springs: MuJoCo's own finite elements (flex), triangles or tetrahedra of first order "
    "with the St. Venant-Kirchhoff law, as rule = 'biquadratic' of truespring on the same cells. In bending and near a "
    "Poisson's ratio of 0.5 they are too stiff. Measure the distance by: python drive.py --file flex.xml",
    "Node i is body and site n<i>, counted from 0 as in the study; nodal forces are actuators of constant force.",
)
