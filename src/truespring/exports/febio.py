"""FEBio input files, format 4.0: plain springs as discrete elements, Gaussian springs as neo-Hookean finite elements.

FEBio was not run. Sections, attributes and their order are those of FEBio's published test suite
(https://github.com/febiosoftware/TestSuite, Verify4); that three-field elements need a material whose volume is split
off is from its source code (FEBioMech/FE3FieldElasticSolidDomain.cpp).
"""

from collections.abc import Iterator, Mapping
from xml.sax.saxutils import escape

import numpy as np

from truespring.arrays import Bools, Floats, Ints, in_space
from truespring.exports.exported import Exported
from truespring.models.spring_data import PRESSURE

# Elements by kind, second order first; those of three fields have one volume change.
_TYPES = {"tetrahedron": "tet4", "pyramid": "pyra5", "wedge": "penta6", "hexahedron": "hex8"}
_EXTRUDED = {"triangle": "wedge", "quadrilateral": "hexahedron"}
_AXES = "xyz"


def febio(exported: Exported) -> Mapping[str, str | bytes]:
    """Return springs.feb, with the displacement of all nodes at each load level in springs.csv when it is run."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        "<!--",
        *(escape(line).replace("--", "- -") for line in (*exported.header, *_explained(exported))),
        "-->",
        '<febio_spec version="4.0">',
        '<Module type="solid"/>',
        *_control(exported.load_steps),
        *(_body(exported) if exported.springs.beyond == PRESSURE else _discrete(exported)),
        "<LoadData>",
        '<load_controller id="1" type="loadcurve"><interpolate>LINEAR</interpolate><extend>CONSTANT</extend>',
        "<points><pt>0,0</pt><pt>1,1</pt></points></load_controller>",
        "</LoadData>",
        "<Output>",
        '<plotfile type="febio"><var type="displacement"/></plotfile>',
        '<logfile><node_data data="ux;uy;uz" delim="," file="springs.csv"/></logfile>',
        "</Output>",
        "</febio_spec>",
        "",
    ]
    return {"springs.feb": "\n".join(lines)}


def _explained(exported: Exported) -> Iterator[str]:
    yield "NOT RUN: FEBio was not run on this file; its structure is that of FEBio's published test suite."
    yield "Run it by: febio4 -i springs.feb"
    yield "Node i of truespring, counted from 0, is node i + 1. Time is the load factor."
    if exported.springs.beyond != PRESSURE:
        yield "Springs are discrete elements with linear springs, whose rest length is the distance of their nodes."
        return
    yield (
        "Gaussian springs are neo-Hookean finite elements. Tetrahedra have FEBio's neo-Hookean, mu/2 (I1 - 3) - mu "
        "ln J + lam/2 (ln J)^2, which is the law of the springs: of first order they are equal."
    )
    yield (
        "Other elements have three fields, for which FEBio requires a law that splits off the volume: Mooney-Rivlin "
        "with c1 = mu/2, c2 = 0 and k = lam + 2/3 mu. It is a TWIN at small strain only."
    )
    if exported.problem.mesh.dim == 2:
        yield "A plane body is a layer of elements; node i + 1 + the number of nodes is above node i + 1."


def _control(steps: int) -> Iterator[str]:
    yield "<Control>"
    yield f"<analysis>STATIC</analysis><time_steps>{steps}</time_steps><step_size>{1 / steps!r}</step_size>"
    yield '<time_stepper type="default"><max_retries>10</max_retries><opt_iter>20</opt_iter><dtmin>0.001</dtmin>'
    yield f"<dtmax>{1 / steps!r}</dtmax></time_stepper>"
    yield '<solver type="solid"><symmetric_stiffness>symmetric</symmetric_stiffness><dtol>1e-6</dtol><etol>1e-9</etol>'
    yield '<rtol>0</rtol><max_refs>30</max_refs><qn_method type="BFGS"><max_ups>0</max_ups></qn_method></solver>'
    yield "</Control>"


def _discrete(exported: Exported) -> Iterator[str]:
    """Yield materials, nodes and springs, a set for each stiffness."""
    network = exported.network
    values, which = np.unique(network.stiffness, return_inverse=True)
    yield "<Mesh>"
    yield from _nodes(in_space(network.nodes))
    yield from _node_sets(*_conditions(exported, layers=1))
    for number in range(len(values)):
        yield f'<DiscreteSet name="springs{number + 1}">'
        for first, second in (network.springs[which.ravel() == number] + 1).tolist():
            yield f"<delem>{first},{second}</delem>"
        yield "</DiscreteSet>"
    yield "</Mesh>"
    yield from _supports(*_conditions(exported, layers=1))
    yield "<Discrete>"
    for number, value in enumerate(values.tolist(), 1):
        name = f'id="{number}" name="k{number}"'
        yield f'<discrete_material {name} type="linear spring"><E>{value!r}</E></discrete_material>'
    for number in range(1, len(values) + 1):
        yield f'<discrete dmat="{number}" discrete_set="springs{number}"/>'
    yield "</Discrete>"


def _body(exported: Exported) -> Iterator[str]:
    """Yield materials, nodes and elements of a continuum, a part for each kind of element and material."""
    layers = 2 if exported.problem.mesh.dim == 2 else 1
    parts = list(_parts(exported))
    yield "<Material>"
    for number, (kind, _, place) in enumerate(parts, 1):
        material = exported.problem.materials[place]
        lam, mu = material.lame
        density = f"<density>{material.density or 1.0!r}</density>"
        if kind.startswith("tet"):
            law = f'type="neo-Hookean">{density}<E>{material.young!r}</E><v>{material.poisson!r}</v>'
        else:
            law = f'type="Mooney-Rivlin">{density}<k>{lam + 2 / 3 * mu!r}</k><c1>{mu / 2!r}</c1><c2>0</c2>'
        yield f'<material id="{number}" name="M{number}" {law}</material>'
    yield "</Material>"
    yield "<Mesh>"
    yield from _nodes(_layered(exported))
    count = 0
    for number, (kind, elements, _) in enumerate(parts, 1):
        yield f'<Elements type="{kind}" name="Part{number}">'
        for nodes in (elements + 1).tolist():
            count += 1
            yield f'<elem id="{count}">{",".join(map(str, nodes))}</elem>'
        yield "</Elements>"
    yield from _node_sets(*_conditions(exported, layers))
    yield "</Mesh>"
    yield "<MeshDomains>"
    for number, (kind, _, _) in enumerate(parts, 1):
        three = "" if kind.startswith("tet") else ' type="three-field-solid"'
        yield f'<SolidDomain name="Part{number}" mat="M{number}"{three}/>'
    yield "</MeshDomains>"
    yield from _supports(*_conditions(exported, layers))


def _parts(exported: Exported) -> Iterator[tuple[str, Ints, int]]:
    """Yield type, nodes and number of the material of the elements, counted from 0."""
    problem, finer = exported.problem, exported.refined
    blocks = [(numbers, part.element, part.elements) for numbers, part in problem.mesh.blocks]
    for numbers, kind, elements in blocks:
        nodes, name = elements, _TYPES.get(_EXTRUDED.get(kind, kind), "")
        if finer is not None and kind == "tetrahedron":
            nodes, name = finer.elements, "tet10"
        if kind in _EXTRUDED:
            nodes = np.concatenate([nodes, nodes + problem.mesh.n_nodes], axis=1)
        for place in range(len(problem.materials)):
            own = problem.material_numbers[numbers] == place
            if own.any():
                yield name, nodes[own], place


def _layered(exported: Exported) -> Floats:
    """Return the nodes in space; of a plane body, those at z = 0 and then those at its thickness."""
    problem = exported.problem
    if problem.mesh.dim == 3:
        return exported.nodes
    assert problem.section is not None
    below = in_space(problem.mesh.nodes)
    return np.concatenate([below, below + np.array([0.0, 0.0, problem.section.thickness])])


def _nodes(nodes: Floats) -> Iterator[str]:
    yield '<Nodes name="Object1">'
    for number, place in enumerate(nodes.tolist(), 1):
        yield f'<node id="{number}">{",".join(map(repr, place))}</node>'
    yield "</Nodes>"


#: Prescribed displacement and forces by direction: nodes, counted from 0, by value.
_Conditions = list[tuple[int, float, Ints]]


def _conditions(exported: Exported, layers: int) -> tuple[_Conditions, _Conditions]:
    """Return prescribed displacements [m] and forces [N] as direction, value and nodes."""
    plain = exported.refined is None or layers == 2
    loading = exported.problem.loading if exported.refined is None or plain else exported.refined.loading
    dim = loading.held.shape[1]
    held = np.ones((len(loading.held), 3), dtype=bool)
    held[:, :dim] = loading.held
    motion, force = in_space(loading.full.motion()), in_space(exported.force_of(loading)) / layers
    if layers == 2:
        above = held.copy()
        section = exported.problem.section
        above[:, 2] = section is not None and not section.free_thickness
        held, motion, force = np.concatenate([held, above]), np.tile(motion, (2, 1)), np.tile(force, (2, 1))
    return _by_value(motion, held), _by_value(force, (force != 0) & ~held)


def _by_value(values: Floats, where: Bools) -> _Conditions:
    """Return the nodes of each direction and value, where `where`; shapes (n, 3)."""
    found: _Conditions = []
    for axis in range(3):
        nodes = np.flatnonzero(where[:, axis])
        distinct, which = np.unique(values[nodes, axis], return_inverse=True)
        found += [(axis, float(value), nodes[which.ravel() == number]) for number, value in enumerate(distinct)]
    return found


def _node_sets(held: _Conditions, forces: _Conditions) -> Iterator[str]:
    for name, several in (("held", held), ("loaded", forces)):
        for number, (_, _, nodes) in enumerate(several, 1):
            yield f'<NodeSet name="{name}{number}">{",".join(map(str, (nodes + 1).tolist()))}</NodeSet>'


def _supports(held: _Conditions, forces: _Conditions) -> Iterator[str]:
    """Yield boundary conditions and nodal loads, which increase with the load curve."""
    yield "<Boundary>"
    for number, (axis, value, _) in enumerate(held, 1):
        name = f'name="Held{number}" node_set="held{number}"'
        if value:
            yield f'<bc {name} type="prescribed displacement"><dof>{_AXES[axis]}</dof><value lc="1">{value!r}</value>'
            yield "<relative>0</relative></bc>"
        else:
            dofs = "".join(f"<{one}_dof>{int(one == _AXES[axis])}</{one}_dof>" for one in _AXES)
            yield f'<bc {name} type="zero displacement">{dofs}</bc>'
    yield "</Boundary>"
    yield "<Loads>"
    for number, (axis, value, _) in enumerate(forces, 1):
        yield f'<nodal_load name="Load{number}" type="nodal_load" node_set="loaded{number}">'
        yield f'<dof>{_AXES[axis]}</dof><scale lc="1">{value!r}</scale></nodal_load>'
    yield "</Loads>"
