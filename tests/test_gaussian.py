"""Gaussian springs: the patch test of every law, finite elements on simplices, closed forms, an independent program."""

from collections.abc import Sequence

import numpy as np
import pytest

import truespring as ts
from tests.closed_forms import lame, material_of, nominal_stress
from tests.law_contract import Body, in_section, settled
from tests.meshes import plane_of_two, random_mesh, shaken, solid_of_four
from truespring.arrays import Floats
from truespring.kernels.threads import set_threads
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.models import LAWS
from truespring.models.fitness import judge
from truespring.models.gaussian import GaussianElements
from truespring.models.gaussian_rule import GAUSSIAN_LAWS
from truespring.models.gaussian_weights import HOURGLASS_LIMITS, STEPPED_HOURGLASS, default_hourglass, laplacians
from truespring.models.heml import HEML_LAWS
from truespring.models.law import Constants
from truespring.models.laws import law_constants

YOUNG, THICKNESS = 900.0, 0.3
SECTIONS = {"plane stress": ts.PlaneStress(THICKNESS), "plane strain": ts.PlaneStrain(THICKNESS)}
MIXED = ("plane of two kinds", "solid of four kinds")
KINDS = (*(name for name, kind in ELEMENT_KINDS.items() if kind.dim > 1), *MIXED)


def mesh_of(kind: str) -> ts.Mesh:
    """Distorted elements of a kind."""
    match kind:
        case "plane of two kinds":
            return shaken(plane_of_two((3.0, 2.0), (3, 2)), 0.15)
        case "solid of four kinds":
            return shaken(solid_of_four(1.0), 0.1)
    return random_mesh(kind, np.random.default_rng(1943))


PLACES = [
    (kind, section)
    for kind in KINDS
    for section in (SECTIONS if kind == MIXED[0] or kind in ("triangle", "quadrilateral") else ("space",))
]
SIMPLICES = [place for place in PLACES if place[0] in ("triangle", "tetrahedron")]


def body(
    mesh: ts.Mesh, section: str = "", poisson: float = 0.3, law: str = "neo-hookean", young: float = YOUNG, **more
) -> ts.Problem:
    """A body that is held and loaded only because a problem must be."""
    last, material = mesh.n_nodes - 1, material_of(law, young, poisson)
    held, load = [ts.Fixed(on=range(last))], [ts.Force(on=[last], total=[1.0] * mesh.dim)]
    return ts.Problem(mesh, material, SECTIONS.get(section), held, load, **more)


def gradient_of(dim: int, seed: int) -> Floats:
    """A large deformation gradient: turned, sheared and stretched."""
    generator = np.random.default_rng(seed)
    turn = np.linalg.qr(generator.normal(size=(dim, dim)))[0]
    turn[0] *= np.sign(np.linalg.det(turn))
    return np.asarray(turn @ (np.eye(dim) + generator.uniform(-0.35, 0.35, (dim, dim))))


def law_in(law: str, material: ts.Material, section: str, dim: int) -> Body:
    constants = Constants(*lame(material.young, material.poisson), section == "plane stress", dict(material.constants))
    return Body(LAWS[law], constants, dim)


def energy_and_stress(of: Body, F: Floats) -> tuple[float, Floats]:
    """Energy density [Pa] and nominal stress P [Pa] of a law's formula in principal stretches."""
    left, stretch, right = np.linalg.svd(F)
    three = in_section(of, stretch)
    P = left @ np.diag(nominal_stress(of.law, of.constants, three)[: of.dim]) @ right
    return float(np.real(of.law.density(three, of.constants))), np.asarray(P)


def facet_areas(nodes: Floats) -> Floats:
    """Integral of N n over a facet for each of its nodes, anticlockwise from outside [m^(d-1)], shape (k, dim)."""
    if len(nodes) == 2:
        (x, y) = nodes[1] - nodes[0]
        return np.array([[y, -x]] * 2) / 2
    if len(nodes) == 3:
        return np.tile(np.cross(nodes[1] - nodes[0], nodes[2] - nodes[0]) / 6, (3, 1))
    signs, found = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), np.zeros((4, 3))
    for r, s in signs / np.sqrt(3):
        shape = (1 + r * signs[:, 0]) * (1 + s * signs[:, 1]) / 4
        along = (signs[:, 0] * (1 + s * signs[:, 1]) / 4) @ nodes
        across = (signs[:, 1] * (1 + r * signs[:, 0]) / 4) @ nodes
        found += np.outer(shape, np.cross(along, across))
    return found


def nodal_forces(mesh: ts.Mesh, stress: Sequence[Floats]) -> Floats:
    """Nodal forces of a uniform nominal stress in each element, over its facets alone [N], shape (n_nodes, dim)."""
    found = np.zeros(mesh.nodes.shape)
    for numbers, part in mesh.blocks:
        for number, element in zip(np.atleast_1d(numbers), part.elements, strict=True):
            for facet in part.kind.facets:
                nodes = element[list(dict.fromkeys(facet))]
                found[nodes] += facet_areas(mesh.nodes[nodes]) @ stress[number].T
    return found * (THICKNESS if mesh.dim == 2 else 1.0)


def apart(one: Floats, other: Floats) -> float:
    """The largest difference over the largest value of what is compared with."""
    size = float(np.abs(other).max())
    assert size > 0
    return float(np.abs(one - other).max()) / size


def gaussian(problem: ts.Problem, **keys: object):
    return ts.Springs("gaussian", **keys).potential(problem)


# --- uniform strain ---------------------------------------------------------------------------------------------------


WITH_HOURGLASS = [(kind, section, 1.4) for kind, section in PLACES if kind in HOURGLASS_LIMITS or kind in MIXED]


@pytest.mark.parametrize("law", GAUSSIAN_LAWS)
@pytest.mark.parametrize(("kind", "section", "hourglass"), [*((*place, None) for place in PLACES), *WITH_HOURGLASS])
def test_patch_test(kind: str, section: str, law: str, hourglass: float | None) -> None:
    """No force at rest; at a uniform F of any size, energy and nodal forces of the law, in regions of two materials."""
    mesh = mesh_of(kind)
    of = [body(mesh, section, poisson, law, young).material for poisson, young in ((0.3, YOUNG), (-0.2, 0.4 * YOUNG))]
    problem = body(mesh, section, 0.3, law, regions=[ts.Region([0], of[1])])
    potential = gaussian(problem, law=law, hourglass=hourglass)
    scale = YOUNG * float(np.ptp(mesh.nodes)) ** (mesh.dim - 1)
    assert np.abs(potential.gradient(mesh.nodes)).max() <= 1e-13 * scale
    for seed in (1, 2):
        F = gradient_of(mesh.dim, seed)
        (density, P), (first_density, first_P) = (
            energy_and_stress(law_in(law, one, section, mesh.dim), F) for one in of
        )
        moved = mesh.nodes @ F.T + 1.0
        stress = [first_P, *[P] * (len(mesh.elements) - 1)]
        assert apart(potential.gradient(moved), nodal_forces(mesh, stress)) < 1e-12
        volumes = mesh.measures * (THICKNESS if mesh.dim == 2 else 1.0)
        energy = first_density * volumes[0] + density * volumes[1:].sum()
        assert potential.energy(moved) == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("poisson", [-0.2, 0.0, 1 / 3, 0.49, 0.499])
def test_patch_test_at_any_poisson_ratio(poisson: float) -> None:
    for kind, section in (("quadrilateral", "plane stress"), ("quadrilateral", "plane strain"), ("hexahedron", "")):
        problem = body(mesh_of(kind), section, poisson)
        assert problem.material is not None
        F = gradient_of(problem.mesh.dim, 4)
        _, P = energy_and_stress(law_in("neo-hookean", problem.material, section, problem.mesh.dim), F)
        expected = nodal_forces(problem.mesh, [P] * len(problem.mesh.elements))
        assert apart(gaussian(problem).gradient(problem.mesh.nodes @ F.T), expected) < 1e-12


@pytest.mark.parametrize("law", GAUSSIAN_LAWS)
@pytest.mark.parametrize("section", ["plane stress", "plane strain", "space"])
@pytest.mark.parametrize("load", ["uniaxial", "equibiaxial", "simple shear"])
def test_closed_forms_of_a_solution(load: str, section: str, law: str) -> None:
    """Stretches, forces and true stress, so the thickness too, of a distorted block, against the law's formula."""
    dim = 3 if section == "space" else 2
    mesh = ts.box((1.0, 1.0, 1.0), (2, 2, 2)) if dim == 3 else ts.rectangle((1.0, 1.0), (3, 3))
    inner = ((mesh.nodes > 0.1) & (mesh.nodes < 0.9)).all(axis=1)
    mesh = ts.Mesh(mesh.nodes + 0.08 * inner[:, None] * np.arange(1.0, dim + 1) / dim, mesh.elements, mesh.element)
    material, F = material_of(law, YOUNG, 0.3), np.eye(dim)
    if load == "simple shear":
        F[0, 1] = 0.4
        rim = np.flatnonzero(~inner)
        supports = [ts.Fixed([node], displacement=mesh.nodes[node] @ (F - np.eye(dim)).T) for node in rim]
    else:
        both = load == "equibiaxial"
        free = [False, not both, section != "plane strain"]
        given = np.where(free, 0.85, [1.4, 1.4 if both else 1.0, 1.0])
        F = np.diag(settled(law_in(law, material, section, dim), given, free)[:dim])
        sides = [ts.Fixed(side, [axis]) for side, axis in zip(("left", "bottom", "back"), "xyz"[:dim], strict=False)]
        moved = [ts.Fixed("right", ["x"], [0.4, *[0.0] * (dim - 1)])]
        moved += [ts.Fixed("top", ["y"], [0.0, 0.4, 0.0][:dim])] if load == "equibiaxial" else []
        supports = sides + moved
    problem = ts.Problem(mesh, material, SECTIONS.get(section), supports)
    path = ts.solve(problem, ts.Springs("gaussian", law=law), ts.Newton(load_steps=2, tolerance=1e-12))
    assert path.status is ts.Status.CONVERGED
    state, (_, P) = path.states[-1], energy_and_stress(law_in(law, material, section, dim), F)
    assert state.displacement == pytest.approx(mesh.nodes @ (F - np.eye(dim)).T, abs=1e-8)
    area = THICKNESS if dim == 2 else 1.0
    right = np.isclose(mesh.nodes[:, 0], 1)
    if load != "simple shear":
        assert state.reaction[right, 0].sum() == pytest.approx(P[0, 0] * area, rel=1e-8)
    potential = path.potential
    assert isinstance(potential, GaussianElements)
    thickness = in_section(law_in(law, material, section, dim), np.linalg.svd(F)[1])[2] if dim == 2 else 1.0
    true = P @ F.T / np.linalg.det(F) / thickness
    found = potential.cauchy_stress(state.positions)[:, :dim, :dim]
    assert np.abs(found - true).max() <= 1e-8 * np.abs(true).max()


# --- the same as finite elements --------------------------------------------------------------------------------------


def check_same(springs: object, other: object, seed: int = 3) -> None:
    """Energy, gradient and Hessian of two potentials of the same nodes are equal at a deformed state."""
    nodes = springs.nodes
    size = np.ptp(nodes, axis=0).max()
    moved = nodes @ gradient_of(nodes.shape[1], seed).T
    moved = moved + 0.03 * size * np.random.default_rng(seed).uniform(-1, 1, nodes.shape)
    assert springs.energy(moved) == pytest.approx(other.energy(moved), rel=1e-12)
    assert springs.energy(moved) > 0
    assert apart(springs.gradient(moved), other.gradient(moved)) < 1e-12
    assert apart(springs.hessian(moved).toarray(), other.hessian(moved).toarray()) < 1e-12


@pytest.mark.parametrize("law", GAUSSIAN_LAWS)
@pytest.mark.parametrize(("kind", "section"), SIMPLICES)
def test_simplices_are_finite_elements(kind: str, section: str, law: str) -> None:
    problem = body(mesh_of(kind), section, 0.4, law)
    springs = gaussian(problem, law=law)
    check_same(springs, ts.Fem(law, "linear").potential(problem))
    if law in HEML_LAWS:
        check_same(springs, ts.Heml(law).potential(problem))


@pytest.mark.parametrize(("kind", "section"), SIMPLICES)
def test_springs_of_second_order_are_finite_elements(kind: str, section: str) -> None:
    """In plane stress, and if lam is zero, of the law at the points; else with its lam part at the mean volume."""
    for poisson in (0.0, 0.45):
        at_points = section == "plane stress" or poisson == 0
        element = "quadratic" if at_points else "quadratic-mean-dilatation"
        problem = body(mesh_of(kind), section, poisson)
        springs = gaussian(problem, element="quadratic")
        check_same(springs, ts.Fem("neo-hookean", element).potential(problem))
        assert np.abs(springs.gradient(springs.nodes)).max() <= 1e-13 * YOUNG * np.ptp(springs.nodes) ** 2


# --- weights ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["quadrilateral", "hexahedron", "wedge"])
def test_volumes_are_sums_over_simplices(kind: str) -> None:
    """Closed forms of volume and slopes against the simplices; 37 elements are not a multiple of the lanes."""
    generator, whole = np.random.default_rng(8), ELEMENT_KINDS[kind]
    counts = (37, 1, 1)[: whole.dim]
    grid = ts.rectangle((37.0, 1.0), counts) if whole.dim == 2 else ts.box((37.0, 1.0, 1.0), counts, kind)
    section = "plane stress" if whole.dim == 2 else ""
    springs = ts.Springs("gaussian").potential(body(grid, section))
    positions = grid.nodes + generator.uniform(-0.3, 0.3, grid.nodes.shape)
    slope, volume = springs._measures.at(positions)
    corners = positions[grid.elements][:, np.array(whole.simplices)]  # axes: element, simplex, corner, direction
    edges = corners[:, :, 1:] - corners[:, :, :1]
    scale = whole.simplex_weight / (6 if whole.dim == 3 else 2 / THICKNESS)
    assert volume == pytest.approx(scale * np.linalg.det(edges).sum(axis=1), rel=1e-12)
    adjugates = np.linalg.inv(edges).swapaxes(2, 3) * np.linalg.det(edges)[..., None, None]
    expected = np.zeros(positions[grid.elements].shape)
    for simplex, by_edges in zip(whole.simplices, scale * adjugates.swapaxes(0, 1), strict=True):
        expected[:, list(simplex[1:])] += by_edges
        expected[:, simplex[0]] -= by_edges.sum(axis=1)
    assert slope.reshape(expected.shape) == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_threads_do_not_change_forces_and_tangent() -> None:
    grid = ts.box((12.0, 8.0, 8.0), (12, 8, 8))
    springs = ts.Springs("gaussian").potential(body(grid))
    positions = grid.nodes + np.random.default_rng(9).uniform(-0.2, 0.2, grid.nodes.shape)

    def found(count: int) -> tuple[Floats, ...]:
        set_threads(count)
        tangents = springs.hessian(positions).data.copy(), springs.projected_hessian(positions).data.copy()
        return springs.gradient(positions), *tangents

    try:
        one, two = found(1), found(2)
    finally:
        set_threads(None)
    assert all(np.array_equal(mine, other) for mine, other in zip(one, two, strict=True))


@pytest.mark.parametrize("kind", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_the_pressure_is_reduced_no_more_than_elements_need(kind: str) -> None:
    """A large share of the pressure, in steps of 1/16, that leaves an element no negative eigenvalue."""
    first = mesh_of(kind)
    mesh = ts.Mesh(first.nodes[first.elements[0]], np.arange(first.elements.shape[1])[None], kind)
    springs = ts.Springs("gaussian").potential(body(mesh, "plane strain" if mesh.dim == 2 else ""))
    generator, reduced = np.random.default_rng(5), []
    for squeeze in np.linspace(0.7, 1.4, 24):
        x = squeeze * mesh.nodes + 0.1 * generator.normal(size=mesh.nodes.shape)
        if not np.isfinite(springs.energy(x)):
            continue
        whole, found = springs.hessian(x).toarray(), springs.projected_hessian(x).toarray()
        lowest, size = np.linalg.eigvalsh(whole)[0], np.abs(whole).max()
        stiffer = springs.hessian(x, 2 * springs.stress(x)).toarray() - whole
        # the springs are of constant stiffness: what a stress adds is the pressure's part, less its share of s s^T
        law, slope = springs._state(x).law.at, springs._measures.at(x)[0].ravel()
        against = np.outer(slope, slope) / springs._volumes / springs._state(x).ratio ** 2
        pressed = stiffer + (law.by_y + np.minimum(law.by_y_y - law.by_y, 0.0)) * against
        left_out = ((whole - found) * pressed).sum() / (pressed**2).sum()
        assert found == pytest.approx(whole - left_out * pressed, abs=1e-10 * size)
        assert np.linalg.eigvalsh(found)[0] >= -1e-9 * size
        if lowest > -1e-12 * size:
            assert abs(left_out) <= 1e-12
        else:
            assert np.linalg.eigvalsh(found + 1.01 / 16 * pressed)[0] < 0
            reduced.append(left_out)
    assert len(reduced) > 3 and 0 < min(reduced) < max(reduced) < 1 + 1e-9


def test_stability_at_rest_of_few_different_elements() -> None:
    """Cubes have no negative eigenvalue; flat bricks have."""
    for sides, poisson, expected in (((2.0, 1.0, 1.0), 0.45, True), ((2.0, 1.0, 0.2), 0.3, False)):
        springs = ts.Springs("gaussian").potential(body(ts.box(sides, (4, 2, 2)), poisson=poisson))
        values = np.linalg.eigvalsh(springs.element_hessians(springs.nodes))
        assert springs.semidefinite_at_rest == expected == bool(values[:, 0].min() > -1e-12 * values.max())
    cubes = ts.box((5.0, 5.0, 5.0), (5, 5, 5))
    moved = shaken(cubes, 0.05, seed=3)
    assert not ts.Springs("gaussian").potential(body(moved)).semidefinite_at_rest  # too many to look at
    two = ts.Springs("gaussian").potential(body(mesh_of("plane of two kinds"), "plane strain"))
    lowest = [float(np.linalg.eigvalsh(part.element_hessians(part.nodes)).min()) for part in two.parts]
    assert two.semidefinite_at_rest == (min(lowest) > -1e-9 * YOUNG)


@pytest.mark.parametrize("section", ["plane stress", "plane strain", ""])
def test_elements_that_are_points_have_infinite_energy(section: str) -> None:
    mesh = ts.rectangle((1.0, 1.0), (2, 2)) if section else ts.box((1.0, 1.0, 1.0), (2, 1, 1))
    potential = ts.Springs("gaussian").potential(body(mesh, section))
    assert potential.energy(np.zeros_like(potential.nodes)) == np.inf  # and no warning


def weights(sides: Sequence[float], poisson: float, hourglass: float | None = None) -> list[float]:
    """The stiffness of edges by axis, face diagonals by plane yz, xz, xy and body diagonals of a brick over mu."""
    dim = len(sides)
    mesh = (ts.rectangle if dim == 2 else ts.box)(sides, (1,) * dim)
    problem = body(mesh, "plane stress" if dim == 2 else "", poisson)
    found = ts.Springs("gaussian", hourglass=hourglass).element_stiffness(problem)[0]
    found /= lame(YOUNG, poisson)[1] * (THICKNESS if dim == 2 else 1.0)
    links = mesh.elements[0][np.array(mesh.kind.links)]
    along = ~np.isclose(mesh.nodes[links[:, 0]], mesh.nodes[links[:, 1]])
    by_class: dict[tuple[bool, ...], float] = {}
    for key, value in zip(map(tuple, along.tolist()), found, strict=True):
        assert by_class.setdefault(key, value) == pytest.approx(value, abs=1e-13)
    return [by_class[key] for key in sorted(by_class, key=lambda key: (sum(key), [-one for one in key]))]


@pytest.mark.parametrize("hourglass", [0.3, 1.0, 4 / 3])
def test_squares(hourglass: float) -> None:
    expected = [hourglass / 6] * 2 + [1 / 2 - hourglass / 6]
    assert weights((0.7, 0.7), 0.2, hourglass) == pytest.approx(expected, abs=1e-14)


def test_squares_have_the_weights_of_finite_elements_by_default() -> None:
    assert weights((0.7, 0.7), 0.2) == pytest.approx(weights((0.7, 0.7), 0.2, 1.0), abs=1e-14)


@pytest.mark.parametrize("A", [0.5, 1.0, 1.9])
def test_rectangles(A: float) -> None:
    B = 1.3
    expected = [B / (3 * A) - A / (6 * B), A / (3 * B) - B / (6 * A), (B / A + A / B) / 6]
    assert weights((A, B), 0.3) == pytest.approx(expected, abs=1e-14)


def test_cubes_by_default() -> None:
    """Face diagonals s = 1/(12 (1 + nu^2)) mu h, body diagonals 1/4 - 2 s, no edges."""
    h = 0.02
    edges, faces, (body_diagonal,) = np.split(np.array(weights((h, h, h), 0.45)) / h, [3, 6])
    assert edges == pytest.approx([0] * 3, abs=1e-13)
    assert faces == pytest.approx([0.0693001] * 3, abs=5e-8)
    assert body_diagonal == pytest.approx(0.1113998, abs=7e-8)


@pytest.mark.parametrize("hourglass", [0.6, 1.0, 1.2, 2.0])
def test_cubes(hourglass: float) -> None:
    """Up to 1 without edges; above, with the stiffness of the xyz mode of finite elements."""
    s, h = hourglass / 12, 0.5
    c = 1 / 4 - 2 * s if hourglass <= 1 else (5 / 6 - 6 * s) / 4
    a = 2 * s - 1 / 4 + c
    expected = np.array([*[a] * 3, *[s - a] * 3, c])
    assert weights((h, h, h), 0.45, hourglass) == pytest.approx(expected * h, abs=1e-14)


def test_triangles_have_cotangent_weights() -> None:
    """mu t cot(opposite angle) / 2; negative across an obtuse angle, which is reported and not an error."""
    corners = np.array([[0.0, 0.0], [2.0, 0.1], [0.9, 0.6]])
    problem = body(ts.Mesh(corners, [[0, 1, 2]], "triangle"), "plane stress")
    sides = np.roll(corners, -1, axis=0) - corners  # 01, 12, 20
    angles = [
        np.arccos(-(a @ b) / np.linalg.norm(a) / np.linalg.norm(b))
        for a, b in zip(sides, np.roll(sides, -1, 0), strict=True)
    ]
    opposite = np.roll(angles, 2)  # the angle of sides 01 and 12 is opposite to 20
    mu = lame(YOUNG, 0.3)[1]
    found = ts.Springs("gaussian").element_stiffness(problem)[0]
    assert found == pytest.approx(mu * THICKNESS / np.tan(opposite) / 2, rel=1e-12)
    assert found.min() < 0
    codes = {finding.code: finding.numbers for finding in judge(problem, ts.Springs("gaussian")).findings}
    assert codes["negative-weights"]["n_negative"] == 1 and "negative" not in codes
    assert gaussian(problem).stiffness.min() == pytest.approx(found.min(), rel=1e-12)


@pytest.mark.parametrize("element", HOURGLASS_LIMITS)
def test_hourglass_limits(element: str) -> None:
    """At the limit an element has a mode without stiffness, just above none; at or below is an error."""
    flat, limit = element == "quadrilateral", HOURGLASS_LIMITS[element]
    mesh = ts.rectangle((1.0, 1.0), (1, 1)) if flat else ts.box((1.0, 1.0, 1.0), (1, 1, 1))
    problem = body(mesh, "plane stress" if flat else "")
    rigid = mesh.dim * (mesh.dim + 1) // 2

    def stiffness(hourglass: float) -> Floats:
        weights = laplacians(problem, np.array([hourglass]))
        law = LAWS["neo-hookean"]
        potential = GaussianElements(problem, law, law_constants(problem, "neo-hookean"), weights)
        values = np.linalg.eigvalsh(potential.hessian(mesh.nodes).toarray())
        return np.asarray(values / values[-1])

    assert (np.abs(stiffness(limit)) < 1e-12).sum() > rigid
    assert stiffness(limit - 0.01)[0] < -1e-4
    for hourglass in (limit + 0.01, 1.0, 3.0):
        assert np.abs(stiffness(hourglass)[:rigid]).max() < 1e-12 and stiffness(hourglass)[rigid] > 1e-4
    for hourglass in (limit, limit - 0.2, np.nan, np.inf):
        with pytest.raises(ts.TruespringError, match="hourglass"):
            gaussian(problem, hourglass=hourglass)


@pytest.mark.parametrize(("moved", "safe"), [(0.15, 0.7), (0.25, 0.8)])
def test_hourglass_limits_of_distorted_hexahedra(moved: float, safe: float) -> None:
    """Just above the limit of bricks some have a mode of negative stiffness; at the values of docs/models.md none."""
    mesh = shaken(ts.box((4.0, 4.0, 4.0), (4, 4, 4)), moved)

    def lowest(hourglass: float) -> float:
        values = np.linalg.eigvalsh(gaussian(body(mesh), hourglass=hourglass).element_hessians(mesh.nodes))
        return float((values[:, 0] / values[:, -1]).min())

    assert lowest(0.55) < -1e-4
    assert lowest(safe) > -1e-12


# --- an independent program -------------------------------------------------------------------------------------------


#: Force [N], hourglass, and displacement of the right middle [m] by that program, which has other code for all of it.
INDEPENDENT = (
    ((0.0, -0.0428), 1.0, (-0.0278922439, -0.0853381957)),
    ((0.0, -0.0428), 4 / 3, (-0.0273396828, -0.0845909046)),
    ((1.2, 0.0), 1.0, (0.0605480099, 0.0)),
    ((1.2, 0.0), 4 / 3, (0.0605412574, 0.0)),
)


def pulled_strip(force: tuple[float, float], hourglass: float) -> tuple[ts.Solution, Floats]:
    """Return the solution of a strip in plane stress, and the displacement of its right middle [m]."""
    mesh = ts.rectangle((0.16, 0.04), (16, 4))
    supports, load = [ts.Fixed("left")], [ts.Force("right", force)]
    problem = ts.Problem(mesh, ts.Material(1e4, 1 / 3), ts.PlaneStress(0.01), supports, load)
    path = ts.solve(problem, ts.Springs("gaussian", hourglass=hourglass), ts.Newton(load_steps=3, tolerance=1e-10))
    middle = np.flatnonzero((np.abs(mesh.nodes - [0.16, 0.02]) < 1e-9).all(axis=1))[0]
    return path, path.states[-1].displacement[middle]


@pytest.mark.parametrize(("force", "hourglass", "expected"), INDEPENDENT)
def test_an_independent_program_gives_the_same(
    force: tuple[float, float], hourglass: float, expected: tuple[float, float]
) -> None:
    path, found = pulled_strip(force, hourglass)
    assert path.status is ts.Status.CONVERGED
    assert found == pytest.approx(expected, abs=1e-9)


# --- errors -----------------------------------------------------------------------------------------------------------

SQUARES, TRIANGLES = (ts.rectangle((2.0, 1.0), (2, 1), kind) for kind in ("quadrilateral", "triangle"))


@pytest.mark.parametrize(
    ("keys", "mesh", "named"),
    [
        ({"sharing": "single"}, SQUARES, "requires the sum over the elements that share a spring: remove sharing"),
        ({"volume": True}, SQUARES, "contains the energy of the change of volume.*: remove volume"),
        ({"element": "quadratic"}, SQUARES, "requires a mesh of triangle or tetrahedron.*quadrilateral.*do not lock"),
        ({"element": "cubic"}, TRIANGLES, "unknown; allowed.*quadratic"),
        ({"element": "quadratic", "law": "gent"}, TRIANGLES, "not available with element.*allowed: neo-hookean"),
        ({"element": "quadratic", "hourglass": 1.0}, TRIANGLES, "no effect on triangle elements: remove it"),
        (
            {"hourglass": 1.0},
            TRIANGLES,
            "no effect on triangle elements: remove it, or use quadrilateral or hexa",
        ),
        ({"law": "hencky"}, SQUARES, "not available with rule = .gaussian.; allowed: neo-hookean"),
        ({"law": "neo-hokean"}, SQUARES, "did you mean 'neo-hookean'"),
        ({"law": "gent"}, SQUARES, "requires jm.*: add it to the material"),
        ({"k_body": 0.1}, SQUARES, "no parameter k_body: use it with isotropic"),
    ],
)
def test_errors(keys: dict[str, object], mesh: ts.Mesh, named: str) -> None:
    problem = ts.Problem(
        mesh, ts.Material(1e4, 0.3), ts.PlaneStress(0.01), [ts.Fixed("left")], [ts.Force("right", (1.0, 0.0))]
    )
    with pytest.raises(ts.TruespringError, match=named):
        ts.Springs("gaussian", **keys).check(problem)


@pytest.mark.parametrize("keys", [{"hourglass": 1.0}, {"law": "gent"}, {"element": "quadratic"}])
def test_keys_of_the_rule_are_of_no_other(keys: dict[str, object]) -> None:
    for springs in ({"rule": "isotropic"}, {"stiffness": ts.UserStiffness(0.4, 0.4)}):
        with pytest.raises(ts.TruespringError, match=next(iter(keys))):
            ts.Springs(**springs, **keys).potential(body(SQUARES, "plane stress"))


def test_stepped_bodies_are_recognised_however_they_are_turned() -> None:
    turn = np.array([[np.cos(0.6), -np.sin(0.6), 0.0], [np.sin(0.6), np.cos(0.6), 0.0], [0.0, 0.3, 1.0]])
    full = ts.box((4.0, 2.0, 2.0), (4, 2, 2))
    used, numbers = np.unique(full.elements[1:], return_inverse=True)
    stepped = ts.Mesh(full.nodes[used], numbers.reshape(-1, 8), full.element)
    for mesh, expected in ((full, 1 / (1 + 0.45**2)), (stepped, STEPPED_HOURGLASS)):
        for nodes in (mesh.nodes, mesh.nodes @ turn.T):
            problem = body(ts.Mesh(nodes, mesh.elements, mesh.element), poisson=0.45)
            assert default_hourglass(problem, 0.45) == expected
