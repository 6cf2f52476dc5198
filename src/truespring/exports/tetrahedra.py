"""The body as MuJoCo's own finite elements beside springs: an approximation with another law."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.equilibrium import Solution, solve
from truespring.errors import MeshError, TruespringError
from truespring.exports.exported import Exported
from truespring.exports.features import Feature, features
from truespring.exports.mjcf import Scene, flex_lines, scene_lines
from truespring.exports.motion import masses
from truespring.exports.surfaces import cells_of
from truespring.exports.whole import nodes_of_the_mesh
from truespring.mesh import Mesh, in_simplices
from truespring.models import Springs
from truespring.problem import Problem
from truespring.remembering import remembered
from truespring.solvers import Newton

# The time step over that of the springs: the tetrahedra of a cube are stiffer than its springs.
_STEP = 0.25


def flex_scene(scene: Scene) -> Mapping[str, str]:
    """Return flex.xml: triangles or tetrahedra of first order with MuJoCo's elasticity; nothing where it has none.

    Bodies without elements and those whose supports move are left out: MuJoCo takes the initial positions as
    undeformed. So are those of several materials, and elements that cannot be divided.
    """
    exported, divided = scene.exported, _divided(scene.exported)
    if divided is None:
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


def flex_values(exported: Exported) -> Mapping[str, Any]:
    """Return what exported.json states of flex.xml: where it comes to rest, solved here; nothing if that is not known.

    MuJoCo's elasticity is that of the rule biquadratic on the same triangles or tetrahedra.
    """
    divided, state = _divided(exported), exported.state
    following = any(feature is Feature.FOLLOWING for feature, _ in features(exported.problem, exported.springs))
    if divided is None or state is None or following:
        return {}
    flexed = _flexed(exported.path, divided, exported.load_steps)
    if flexed is None:
        return {}
    away = np.linalg.norm(flexed - state.displacement, axis=1)
    largest = float(np.linalg.norm(state.displacement, axis=1).max())
    values = {
        "file": "flex.xml",
        "probe_displacement": flexed[exported.probe].tolist(),
        "largest_difference": float(away.max() / largest),
    }
    return {"flex": values}


@remembered
def _flexed(path: Solution, divided: Mesh, load_steps: int) -> Floats | None:
    """Return the displacement of the divided body at full load [m], None if it is not found."""
    problem = path.problem
    body = Problem(divided, problem.materials[0], problem.section, stated=False)
    try:
        found = solve(problem, Springs("biquadratic").potential(body), Newton(load_steps=load_steps)).at(1.0)
    except TruespringError:
        return None
    return found.displacement if found is not None and found.load_factor == 1.0 else None


def _divided(exported: Exported) -> Mesh | None:
    """Return the mesh of flex.xml, None if MuJoCo has no such body."""
    problem = exported.problem
    if len(problem.materials) != 1 or exported.motion.any() or exported.section == "plane strain":
        return None
    try:
        return in_simplices(problem.mesh)[0]
    except MeshError:
        return None


_EXPLAINED = (
    "AN APPROXIMATION, not the springs: MuJoCo's own finite elements (flex), triangles or tetrahedra of first order "
    "with the St. Venant-Kirchhoff law, as rule = 'biquadratic' of truespring on the same cells. In bending and near a "
    "Poisson's ratio of 0.5 they are too stiff. Measure the distance by: python drive.py --file flex.xml",
    "Node i is body and site n<i>, counted from 0 as in the study; nodal forces are actuators of constant force.",
)
