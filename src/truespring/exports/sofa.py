"""Python scenes for SOFA, of springs and finite elements. Experimental: SOFA was not run.

Components, the names of their data and what they compute were checked against the source code of SOFA
(https://github.com/sofa-framework/sofa) and SofaPython3. StiffSpringForceField is SpringForceField since v24.06.
"""

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from truespring.arrays import Bools, Floats, in_space
from truespring.exports.exported import Exported
from truespring.exports.sofa_field import (
    FIELD,
    FIELD_EXPLAINED,
    FIELD_IMPORTS,
    FIELD_MODULES,
    HYPERELASTIC,
    NATIVE,
    NATIVE_EXPLAINED,
    OF_MATERIALS,
    field_files,
    native_material,
)
from truespring.mesh.facets import triangles_of

#: The version of SOFA whose source code the scene was checked against.
CHECKED = "SOFA v26.12 in development, commit 2a278d8 of 2026-08-06; the names are those of v25.06 and v26.06 too"

# SOFA plugins of the components of a scene.
_PLUGINS = (
    "Sofa.Component.Constraint.Projective",
    "Sofa.Component.LinearSolver.Direct",
    "Sofa.Component.MechanicalLoad",
    "Sofa.Component.ODESolver.Backward",
    "Sofa.Component.SolidMechanics.FEM.Elastic",
    "Sofa.Component.SolidMechanics.FEM.HyperElastic",
    "Sofa.Component.SolidMechanics.Spring",
    "Sofa.Component.StateContainer",
    "Sofa.Component.Topology.Container.Constant",
    "Sofa.Component.Visual",
)

# Numbers per line.
_A_LINE = 8

# Name in a topology, and component, of the finite elements for each kind of element.
_ELEMENTS = {
    "triangle": ("triangles", "TriangleFEMForceField"),
    "quadrilateral": ("triangles", "TriangleFEMForceField"),
    "tetrahedron": ("tetrahedra", "TetrahedronFEMForceField"),
    "hexahedron": ("hexahedra", "HexahedronFEMForceField"),
}


def sofa(exported: Exported) -> Mapping[str, str | bytes]:
    """Return springs_scene.py, with createScene(root) for runSofa, and main() to run it by Python.

    Springs beyond plain ones also need truespring_forces.py and springs.npz.
    """
    beyond = bool(exported.springs.beyond)
    lines = [
        '"""' + "\n".join(_docstring(exported)),
        '"""',
        "",
        *(FIELD_IMPORTS if beyond else ()),
        "import Sofa",
        "import Sofa.Core",
        "import Sofa.Simulation",
        "import SofaRuntime",
        *(FIELD_MODULES if beyond else ()),
        "",
        *_data(exported),
        FIELD if beyond else NATIVE,
        _SCENE,
    ]
    scene = {"springs_scene.py": "\n".join(lines)}
    return scene | (field_files(exported) if beyond else {})


def _docstring(exported: Exported) -> Iterator[str]:
    field = FIELD_EXPLAINED if exported.springs.beyond else NATIVE_EXPLAINED
    for line in [*exported.header, *_EXPLAINED, *field, *_of_elements(exported)]:
        safe = line.replace("\\", "/").replace('"', "'")
        yield from textwrap.wrap(safe, 110, subsequent_indent="    ", break_long_words=False) or [""]


_EXPLAINED = (
    "EXPERIMENTAL: SOFA was not run on this file. It was checked against the source code of " + CHECKED + ".",
    "Run it by: runSofa -l SofaPython3 springs_scene.py, or if SofaPython3 is on the path: python springs_scene.py.",
    "Nodes and springs are counted from 0 as in the study; a plane body lies in z = 0 and is held there.",
    "Loads and prescribed displacements increase to their full values in LOAD_STEPS animation steps, each a static "
    "solve; nodes that a support rotates move along straight lines.",
)


def _of_elements(exported: Exported) -> Iterator[str]:
    """Yield sentences on the finite elements of the scene, which differ from those of Fem."""
    element = exported.problem.mesh.element
    if not exported.problem.materials:
        yield "A network has no finite elements. It starts from the first load level that truespring reached."
        return
    if exported.refined is not None:
        yield "There are no finite elements: the springs join nodes that SOFA's elements do not have."
        return
    if element not in _ELEMENTS:
        yield f"There are no finite elements: {exported.problem.mesh.kinds} elements are not exported to SOFA."
        return
    if material := native_material(exported):
        yield (f"The finite elements are SOFA's {HYPERELASTIC}, material {material}: {OF_MATERIALS[material]}")
        return
    yield (
        f"The finite elements are SOFA's {_ELEMENTS[element][1]}, method 'large': corotational linear elasticity, "
        "which is not a law of truespring; at small strain they agree."
    )
    if element == "quadrilateral":
        yield "Each quadrilateral is divided into two triangles, which are stiffer in bending."
    if element == "hexahedron":
        yield "SOFA's hexahedra are exact only for axis-aligned bricks."


def _data(exported: Exported) -> Iterator[str]:
    """Yield the constants of the scene, each with a comment."""
    loading = exported.problem.loading if exported.refined is None else exported.refined.loading
    nodes, network = in_space(exported.nodes), exported.springs.network
    held = np.ones(nodes.shape, dtype=bool)
    held[:, : loading.held.shape[1]] = loading.held
    motion = in_space(loading.full.motion())
    force = np.where(held, 0.0, in_space(exported.force_of(loading)))
    loaded = np.flatnonzero(force.any(axis=1))
    moved = np.argwhere(motion != 0)
    probe = [exported.probe, None if exported.state is None else _probed(exported)]
    yield from _named("PLUGINS", list(_PLUGINS), "SOFA plugins of the components")
    yield from _named("LOAD_STEPS", exported.load_steps, "animation steps up to full load")
    yield from _named("NODES", nodes, "undeformed positions [m]")
    yield from _named("START", _start(exported), "initial positions [m], None if undeformed")
    if not exported.springs.beyond and network is not None:
        yield from _named("SPRINGS", network.springs, "the two nodes of each spring")
        yield from _named("STIFFNESS", network.stiffness, "stiffness of each spring [N/m]")
        yield from _named("REST_LENGTH", network.rest_length, "rest length of each spring [m]")
    yield from _named("HELD", _held(held), "whether x, y, z are held, and the nodes of which")
    yield from _named("LOADED", loaded, "nodes with a force")
    yield from _named("FORCES", force[loaded], "force on each of LOADED at full load [N]")
    motions = [(int(node), int(axis), float(motion[node, axis])) for node, axis in moved]
    yield from _named("MOTIONS", motions, "node, direction and prescribed displacement at full load [m]")
    yield from _named("PROBE", probe, "probe node and its expected displacement at full load [m]")
    yield from _named("FEM", _elements(exported), "the finite elements, None if there are none")


def _start(exported: Exported) -> Floats | None:
    """Return the positions at the first load level, for networks: at rest one may be a mechanism, which is singular."""
    loaded = exported.path.states[1:]
    return in_space(loaded[0].positions) if loaded and not exported.problem.materials else None


def _named(name: str, value: Any, what: str) -> Iterator[str]:
    plain = value.tolist() if isinstance(value, np.ndarray) else value
    yield f"# {what}"
    if not isinstance(plain, list) or len(plain) < _A_LINE:
        yield f"{name} = {plain!r}"
        return
    rows = _A_LINE if isinstance(plain[0], int | float) else 1
    yield f"{name} = ["
    for first in range(0, len(plain), rows):
        yield f"    {', '.join(map(repr, plain[first : first + rows]))},"
    yield "]"


def _probed(exported: Exported) -> list[float]:
    assert exported.state is not None
    return [float(part) for part in in_space(exported.state.displacement)[exported.probe]]


def _held(held: Bools) -> list[tuple[list[int], list[int]]]:
    """Return each pattern of held directions and its nodes; nodes without held directions are left out."""
    patterns, which = np.unique(held, axis=0, return_inverse=True)
    return [
        ([int(one) for one in pattern], np.flatnonzero(which.ravel() == number).tolist())
        for number, pattern in enumerate(patterns)
        if pattern.any()
    ]


def _elements(exported: Exported) -> dict[str, Any] | None:
    """Return component, topology and material of the finite elements."""
    problem = exported.problem
    if not problem.materials or problem.mesh.element not in _ELEMENTS or exported.refined is not None:
        return None
    topology, component = _ELEMENTS[problem.mesh.element]
    if material := native_material(exported):
        lame = problem.materials[0].lame
        data = {"materialName": material, "ParameterSet": [float(lame.mu), float(lame.lam)]}
        return {"component": HYPERELASTIC, "topology": {topology: problem.mesh.elements.tolist()}, "data": data}
    elements = problem.mesh.elements if problem.mesh.dim == 3 else triangles_of(problem.mesh.elements)
    times = len(elements) // len(problem.mesh.elements)
    plane: dict[str, Any] = {}
    if problem.section is not None and problem.mesh.dim == 2:
        plane = {"thickness": problem.section.thickness, "planeStrain": exported.section == "plane strain"}

    def by_element(values: Floats) -> list[float]:
        """Return one value if all elements have the same, else one for each element."""
        return [float(values[0])] if (values == values[0]).all() else np.tile(values, times).tolist()

    return {
        "component": component,
        "topology": {topology: elements.tolist()},
        "data": {
            "method": "large",
            "youngModulus": by_element(problem.of_elements(lambda material: material.young)),
            "poissonRatio": by_element(problem.of_elements(lambda material: material.poisson)),
            **plane,
        },
    }


# The part that is the same in every scene. Damping is 0 since SOFA's default is not; of the stopping thresholds one is
# absolute by default. Full Newton steps, without line search: when a slender body rotates, the residual grows before
# it falls, and a line search on it needs three times as many steps.
_SCENE = '''

class Levels(Sofa.Core.Controller):
    """Increases forces and prescribed displacements of a body to their full values, one level per animation step."""

    def __init__(self, dofs, forces, *args, **kwargs):
        Sofa.Core.Controller.__init__(self, *args, **kwargs)
        self.dofs, self.forces, self.level = dofs, forces, 0

    def onAnimateBeginEvent(self, event):
        self.level = min(self.level + 1, LOAD_STEPS)
        share = self.level / LOAD_STEPS
        if self.forces is not None:
            self.forces.forces.value = [[share * part for part in force] for force in FORCES]
        if MOTIONS:
            with self.dofs.position.writeableArray() as positions:
                for node, axis, motion in MOTIONS:
                    positions[node][axis] = NODES[node][axis] + share * motion


def add_body(root, name):
    """Add a body with solver, supports and loads, without springs or elements."""
    body = root.addChild(name)
    body.addObject(
        "NewtonRaphsonSolver",
        name="newton",
        maxNbIterationsNewton=100,
        maxNbIterationsLineSearch=1,
        warnWhenLineSearchFails=False,
        relativeInitialStoppingThreshold=1e-8,
        relativeSuccessiveStoppingThreshold=0.0,
        absoluteResidualStoppingThreshold=0.0,
    )
    body.addObject("StaticSolver", newtonSolver="@newton")
    body.addObject("SparseLDLSolver")
    dofs = body.addObject(
        "MechanicalObject", name="dofs", template="Vec3", position=START or NODES, rest_position=NODES
    )
    for directions, nodes in HELD:
        if all(directions):
            body.addObject("FixedProjectiveConstraint", indices=nodes)
        else:
            body.addObject("PartialFixedProjectiveConstraint", indices=nodes, fixedDirections=directions)
    forces = None
    if LOADED:
        nothing = [[0.0, 0.0, 0.0]] * len(LOADED)
        forces = body.addObject("ConstantForceField", name="load", indices=LOADED, forces=nothing)
    body.addObject(Levels(dofs, forces, name="levels"))
    return body


def createScene(root):
    root.gravity = [0.0, 0.0, 0.0]  # weight is included in the forces
    root.addObject("RequiredPlugin", pluginName=PLUGINS)
    root.addObject("DefaultAnimationLoop")
    root.addObject("VisualStyle", displayFlags="showBehaviorModels showForceFields showInteractionForceFields")
    add_springs(add_body(root, "springs"))
    if FEM is not None:
        elements = add_body(root, "fem")
        elements.addObject("MeshTopology", name="mesh", position=NODES, **FEM["topology"])
        elements.addObject(FEM["component"], name="elements", template="Vec3", topology="@mesh", **FEM["data"])
    return root


def main():
    root = Sofa.Core.Node("root")
    createScene(root)
    Sofa.Simulation.initRoot(root)
    for _ in range(LOAD_STEPS):
        Sofa.Simulation.animate(root, root.dt.value)
    node, expected = PROBE
    for body in root.children:
        place = body.dofs.position.value[node]
        print(body.name.value, "node", node, "displacement", [p - q for p, q in zip(place, NODES[node])], "m")
    print("expected displacement of the springs", expected, "m")


if __name__ == "__main__":
    main()
'''
