"""The springs of a SOFA scene: the native component for plain springs, a force field in Python for others.

The methods of the force field and what they are called with were checked against the source code of SofaPython3
(Binding_ForceField.cpp), the materials against SOFA's TetrahedronHyperelasticityFEMForceField.
"""

from collections.abc import Mapping
from importlib.resources import files
from types import MappingProxyType

from truespring.exports.arrays import npz
from truespring.exports.exported import Exported
from truespring.models.spring_data import COUPLING, PRESSURE

#: The module that computes energy, forces and tangent stiffness, written beside the scene.
FORCES = "truespring_forces.py"
#: Component of hyperelastic tetrahedra in SOFA.
HYPERELASTIC = "TetrahedronHyperelasticityFEMForceField"
#: What SOFA's materials are, as sentences.
OF_MATERIALS: Mapping[str, str] = MappingProxyType(
    {
        "StableNeoHookean": "mu/2 (I1 - 3) + (lam + mu)/2 (J - 1 - mu / (lam + mu))^2, which equals the springs at "
        "small strain.",
        "StVenantKirchhoff": "the same function of the positions as the springs.",
    }
)
# The material that equals springs on tetrahedra, by their feature beyond plain springs.
_MATERIALS = {PRESSURE: "StableNeoHookean", COUPLING: "StVenantKirchhoff"}


def native_material(exported: Exported) -> str:
    """Return the material of SOFA that the springs on tetrahedra of one material equal; "" if there is none."""
    problem = exported.problem
    if problem.mesh.element != "tetrahedron" or len(problem.materials) != 1:
        return ""
    return _MATERIALS.get(exported.springs.beyond, "")


def field_files(exported: Exported) -> dict[str, str | bytes]:
    """Return the module and the arrays that a scene with a force field in Python needs."""
    return {FORCES: files("truespring.exports").joinpath(FORCES).read_text(encoding="utf-8"), **npz(exported)}


NATIVE_EXPLAINED = ("SOFA ignores springs shorter than 1e-9 m.",)
FIELD_EXPLAINED = (
    f"The springs are a Sofa.Core.ForceFieldVec3d in Python; {FORCES} computes its forces and stiffness from "
    "springs.npz by NumPy, both in the folder of this file. That module was run, and agrees with truespring; "
    "the scene was not.",
)
FIELD_IMPORTS = ("import sys", "from pathlib import Path", "", "import numpy")
FIELD_MODULES = (
    "",
    "FOLDER = Path(__file__).resolve().parent",
    "sys.path.insert(0, str(FOLDER))",
    "from truespring_forces import Forces  # noqa: E402",
)

#: Adds plain springs to a scene.
NATIVE = '''

def add_springs(body):
    """Add the springs to a body."""
    body.addObject(
        "SpringForceField",
        name="springs",
        template="Vec3",
        object1="@dofs",
        object2="@dofs",
        springsIndices1=[first for first, _ in SPRINGS],
        springsIndices2=[second for _, second in SPRINGS],
        stiffness=STIFFNESS,
        damping=[0.0] * len(SPRINGS),
        lengths=REST_LENGTH,
        elongationOnly=[False] * len(SPRINGS),
        enabled=[True] * len(SPRINGS),
    )
'''

#: Adds other springs to a scene.
FIELD = '''

class TrueSprings(Sofa.Core.ForceFieldVec3d):
    """The springs: forces at the positions, and their derivatives at the last positions that forces were asked for."""

    def __init__(self, forces, *args, **kwargs):
        Sofa.Core.ForceFieldVec3d.__init__(self, *args, **kwargs)
        self.core, self.dim = forces, forces.nodes.shape[1]
        self.at, self.entries = forces.nodes, None

    def addForce(self, m, out_force, pos, vel):
        self.at, self.entries = numpy.array(pos.value, dtype=float)[:, : self.dim], None
        with out_force.writeableArray() as force:
            force[:, : self.dim] -= self.core.gradient(self.at)

    def tangent(self):
        if self.entries is None:
            self.entries = self.core.summed_tangent(self.at)
        return self.entries

    def addDForce(self, m, dforce, dx):
        rows, columns, values = self.tangent()
        step = numpy.array(dx.value, dtype=float)[:, : self.dim]
        change = numpy.bincount(rows, values * step.ravel()[columns], step.size).reshape(step.shape)
        with dforce.writeableArray() as force:
            force[:, : self.dim] -= m["kFactor"] * change

    def addKToMatrix(self, m, n_nodes, n_dofs):
        rows, columns, values = self.tangent()
        places = [n_dofs * (place // self.dim) + place % self.dim for place in (rows, columns)]
        return numpy.stack([*places, -m["kFactor"] * values], axis=1)


def add_springs(body):
    """Add the springs to a body."""
    with numpy.load(FOLDER / "springs.npz") as file:
        forces = Forces({name: file[name] for name in file.files})
    body.addObject(TrueSprings(forces, name="springs"))
'''
