"""FEBio's input file, read by ElementTree: its numbers are those of the study. FEBio itself is not run."""

from xml.etree import ElementTree

import numpy as np
import pytest

import truespring as ts
from tests.exports import exported
from truespring.exports import Exported, solve_springs, target_files

#: Sections of a file, in the order of FEBio's test suite.
ORDER = ("Module", "Control", "Material", "Mesh", "MeshDomains", "Boundary", "Loads", "Discrete", "LoadData", "Output")


def tree(one: Exported) -> ElementTree.Element:
    return ElementTree.fromstring(str(target_files(one, ["febio"])["febio"]["springs.feb"]))


def gaussian(element: str) -> Exported:
    mesh = (
        ts.rectangle((0.04, 0.02), (4, 2), element)
        if element in ("triangle", "quadrilateral")
        else ts.box((0.04, 0.02, 0.02), (2, 1, 1), element)
    )
    problem = ts.Problem(
        mesh,
        ts.Material(10e3, 0.3),
        ts.PlaneStrain(0.01) if mesh.dim == 2 else None,
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(0.02, 0.03, 0.01)[: mesh.dim])],
    )
    return solve_springs(problem, ts.Springs("gaussian"), ts.Newton(load_steps=2))


@pytest.mark.parametrize("element", ["hexahedron", "tetrahedron", "wedge", "quadrilateral"])
def test_elements_material_supports_and_loads_are_those_of_the_study(element: str) -> None:
    one = gaussian(element)
    root, mesh, lame = tree(one), one.problem.mesh, one.problem.materials[0].lame
    assert root.get("version") == "4.0"
    assert [part.tag for part in root] == [name for name in ORDER if name != "Discrete"]
    nodes = np.array([[float(part) for part in str(node.text).split(",")] for node in root.iter("node")])
    layers = 2 if mesh.dim == 2 else 1
    assert (nodes[: mesh.n_nodes, : mesh.dim] == mesh.nodes).all() and len(nodes) == layers * mesh.n_nodes
    elements = np.array([[int(part) for part in str(one.text).split(",")] for one in root.iter("elem")]) - 1
    kind = {"hexahedron": "hex8", "tetrahedron": "tet4", "wedge": "penta6", "quadrilateral": "hex8"}[element]
    assert [one.get("type") for one in root.iter("Elements")] == [kind]
    solid = {"hex8": "hexahedron", "tet4": "tetrahedron", "penta6": "wedge"}[kind]
    volume = ts.Mesh(nodes, elements, solid).measures.sum()
    assert volume == pytest.approx(mesh.measures.sum() * (0.01 if mesh.dim == 2 else 1.0))
    (material,) = root.iter("material")
    values = {part.tag: float(str(part.text)) for part in material}
    if element == "tetrahedron":
        assert material.get("type") == "neo-Hookean" and (values["E"], values["v"]) == (10e3, 0.3)
    else:
        assert material.get("type") == "Mooney-Rivlin" and values["c2"] == 0
        assert (2 * values["c1"], values["k"]) == pytest.approx((lame.mu, lame.lam + 2 / 3 * lame.mu))
        assert [part.get("type") for part in root.iter("SolidDomain")] == ["three-field-solid"]
    sets = {part.get("name"): [int(n) - 1 for n in str(part.text).split(",")] for part in root.iter("NodeSet")}
    force = np.zeros(nodes.shape)
    for load in root.iter("nodal_load"):
        force[sets[load.get("node_set")], "xyz".index(str(load.findtext("dof")))] += float(str(load.findtext("scale")))
    total = force.sum(axis=0)
    assert total[: mesh.dim] == pytest.approx(one.problem.loading.external_force.sum(axis=0))
    held = np.zeros(nodes.shape, dtype=bool)
    for bc in root.iter("bc"):
        for axis in range(3):
            held[sets[bc.get("node_set")], axis] |= bc.findtext(f"{'xyz'[axis]}_dof") == "1"
    assert (held[: mesh.n_nodes, : mesh.dim] == one.problem.loading.held).all()
    assert held[:, 2].all() == (mesh.dim == 2)


@pytest.mark.parametrize("case", ["block", "moved"])
def test_springs_are_discrete_elements(case: str) -> None:
    one = exported(case)
    root, network = tree(one), one.network
    stiffness = {part.get("id"): float(str(part.findtext("E"))) for part in root.iter("discrete_material")}
    of = {part.get("discrete_set"): stiffness[part.get("dmat")] for part in root.iter("discrete")}
    found = {}
    for several in root.iter("DiscreteSet"):
        for spring in several:
            a, b = (int(part) - 1 for part in str(spring.text).split(","))
            found[a, b] = of[several.get("name")]
    wanted = dict(zip(map(tuple, network.springs.tolist()), network.stiffness.tolist(), strict=True))
    assert found == wanted
    values = [float(str(bc.findtext("value"))) for bc in root.iter("bc") if bc.get("type") == "prescribed displacement"]
    assert sorted(values) == sorted(set(one.motion[one.motion != 0].tolist()))
