"""Fibres and active tension: closed forms, agreement of models, directions from files, errors."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, root

import truespring as ts
from tests.meshes import plane_of_two, shaken, solid_of_four
from truespring.arrays import Floats
from truespring.errors import ModelError, ProblemError, StudyError
from truespring.exports import TARGETS
from truespring.exports.calculix import fem_deck
from truespring.exports.features import Feature
from truespring.mesh import CELL_SHAPES, quadrature, refined, square_stretch_forms
from truespring.mesh.files.vtu_writing import write_vtu
from truespring.models import LAWS, Model
from truespring.models.fibres import fibre_energy
from truespring.problem import sample
from truespring.study import read_study

YOUNG, POISSON = 3.0, 0.3
MU, LAM = YOUNG / 2 / (1 + POISSON), YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON)
K1, K2 = 2.0, 1.5
MODELS: dict[str, Model] = {
    "gaussian": ts.Springs("gaussian"),
    "fem": ts.Fem("neo-hookean", "linear"),
    "mean dilatation": ts.Fem("neo-hookean", "mean-dilatation"),
}
SECOND_ORDER: dict[str, Model] = {
    "gaussian": ts.Springs("gaussian", element="quadratic"),
    "fem": ts.Fem("neo-hookean", "quadratic"),
}


def body(
    mesh: ts.Mesh, along: object, k1: float = K1, k2: float = K2, loads: object = None, supports: object = None
) -> ts.Problem:
    """A body of unit thickness in plane stress, or in 3D; held everywhere unless supports are given."""
    material = ts.Material(YOUNG, POISSON, fibres=ts.Fibres(along, k1, k2 if k1 else 0.0))  # type: ignore[arg-type]
    held = supports or [ts.Fixed(np.arange(mesh.n_nodes))]  # type: ignore[arg-type]
    acting = loads or [ts.ActiveTension(1.0)]
    return ts.Problem(mesh, material, ts.PlaneStress(1.0) if mesh.dim == 2 else None, held, acting)  # type: ignore[arg-type]


def sliding(mesh: ts.Mesh) -> list[ts.Fixed]:
    """A corner block: three planes of symmetry, so that a uniform strain along the axes is free."""
    sides = {2: (("left", "x"), ("bottom", "y")), 3: (("left", "x"), ("bottom", "y"), ("back", "z"))}
    return [ts.Fixed(side, fix=[axis]) for side, axis in sides[mesh.dim]]


def nominal(stretches: Floats, along: Floats, k1: float = K1, k2: float = K2, tension: float = 0.0) -> Floats:
    """Nominal stress of the neo-Hookean law and one family of fibres in principal directions, from first principles.

    P_i = mu (s_i - 1 / s_i) + lam ln J / s_i + 2 k1 <I4 - 1> exp(k2 <I4 - 1>^2) a_i^2 s_i + T a_i^2 s_i / sqrt(I4).
    """
    log = np.log(stretches.prod())
    I4 = float((along**2 * stretches**2).sum())
    x = max(I4 - 1, 0.0)
    isotropic = MU * (stretches - 1 / stretches) + LAM * log / stretches
    pull = 2 * k1 * x * np.exp(k2 * x**2) + tension / np.sqrt(I4)
    return np.asarray(isotropic + pull * along**2 * stretches)


def uniaxial(stretch: float, along: Floats, **given: float) -> tuple[float, Floats]:
    """Stress along x and the three stretches of a bar whose sides are free."""

    def across(free: Floats) -> Floats:
        return nominal(np.array([stretch, *free]), along, **given)[1:]

    free = root(across, [stretch**-0.3] * 2, tol=1e-12)
    assert np.abs(across(free.x)).max() < 1e-12
    stretches = np.array([stretch, *free.x])
    return float(nominal(stretches, along, **given)[0]), stretches


# --- closed forms -------------------------------------------------------------------------------------


@pytest.mark.parametrize("along", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
@pytest.mark.parametrize("stretch", [0.8, 1.3])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", MODELS)
def test_a_strip_with_fibres_along_and_across(along: tuple[float, ...], stretch: float, dim: int, name: str) -> None:
    """The force of a strip of unit section stretched along x, its sides free; compressed fibres bear nothing."""
    stress, stretches = uniaxial(stretch, np.array(along))
    if stretch < 1 and along[0]:
        assert stress == pytest.approx(uniaxial(stretch, np.array(along), k1=0.0)[0], rel=1e-14)
    mesh = ts.rectangle((2.0, 1.0), (2, 1)) if dim == 2 else ts.box((2.0, 1.0, 1.0), (2, 1, 1))
    moved = ts.Fixed("right", fix=["x"], displacement=[2 * (stretch - 1), *[0.0] * (dim - 1)])
    problem = body(mesh, along[:dim], loads=[ts.Force("right", [0.0] * dim)], supports=[*sliding(mesh), moved])
    state = ts.solve(problem, MODELS[name], ts.Newton(load_steps=2, tolerance=1e-12)).states[-1]
    assert state.positions == pytest.approx(mesh.nodes * stretches[:dim], abs=1e-8)
    assert state.reaction[mesh.nodes[:, 0] == 2.0, 0].sum() == pytest.approx(stress, rel=1e-8)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize(("tension", "steps"), [(0.8, 1), (0.8, 3), (-0.4, 1)])
def test_an_active_strip_has_the_length_of_its_closed_form(name: str, tension: float, steps: int) -> None:
    """It shortens; under a negative tension it extends, against the stiffness of the fibres."""
    along = np.array([1.0, 0.0, 0.0])

    def left(stretch: float) -> float:
        return uniaxial(stretch, along, tension=tension)[0]

    ends = (0.4, 1.0) if tension > 0 else (1.0, 1.5)
    stretches = uniaxial(brentq(left, *ends, xtol=1e-14), along, tension=tension)[1]
    mesh = ts.box((2.0, 1.0, 1.0), (2, 1, 1))
    problem = body(mesh, tuple(along), loads=[ts.ActiveTension(tension)], supports=sliding(mesh))
    path = ts.solve(problem, MODELS[name], ts.Newton(load_steps=steps, tolerance=1e-12))
    assert path.status is ts.Status.CONVERGED
    assert path.states[-1].positions == pytest.approx(mesh.nodes * stretches, abs=1e-8)


def test_in_a_linear_theory_an_active_tension_is_a_dead_stress() -> None:
    """Hooke's law: a free strip under the stress -T along its fibres has the strain -T / E."""
    mesh = ts.rectangle((2.0, 1.0), (2, 1))
    problem = body(mesh, (1.0, 0.0), k1=0.0, loads=[ts.ActiveTension(0.3)], supports=sliding(mesh))
    state = ts.solve(problem, ts.Fem("linear")).states[-1]
    strain = -0.3 / YOUNG
    assert state.displacement == pytest.approx(mesh.nodes * np.array([strain, -POISSON * strain]), abs=1e-10)


@pytest.mark.parametrize("name", MODELS)
def test_two_families_of_an_artery_at_equal_angles_stay_symmetric(name: str) -> None:
    """A cube with families at +-30 degrees to x, as in an artery's wall: no shear, the stress of both in sum."""
    angle = np.radians(30)
    families = [(np.cos(angle), np.sin(angle), 0.0), (np.cos(angle), -np.sin(angle), 0.0)]
    stretches = np.array([1.25, 1.05, 0.8])
    mesh = ts.box((1.0, 1.0, 1.0), (1, 1, 1))
    potential = MODELS[name].potential(body(mesh, families))
    force = potential.gradient(mesh.nodes * stretches)
    expected = nominal(stretches, np.array(families[0]), k1=2 * K1)
    for axis in range(3):
        assert force[mesh.nodes[:, axis] == 1.0].sum(axis=0) == pytest.approx(
            np.eye(3)[axis] * expected[axis], abs=1e-12
        )


# --- energy and derivatives ---------------------------------------------------------------------------


def test_the_energy_of_fibres_and_its_derivatives() -> None:
    I4 = np.array([0.7, 1.1, 1.6])
    for k2 in (0.0, K2):
        energy, first, second = fibre_energy(I4, np.array(K1), np.array(k2))
        assert (energy[0], first[0], second[0]) == (0, 0, 0)
        step = 1e-6
        ahead, behind = (fibre_energy(I4 + way * step, np.array(K1), np.array(k2)) for way in (1, -1))
        assert (ahead[0] - behind[0]) / (2 * step) == pytest.approx(first, rel=1e-8, abs=1e-9)
        assert (ahead[1] - behind[1]) / (2 * step) == pytest.approx(second, rel=1e-8, abs=1e-9)
    assert fibre_energy(I4, np.array(K1), np.array(1e-9))[0] == pytest.approx(K1 / 2 * np.maximum(I4 - 1, 0) ** 2)


KINDS: dict[str, Callable[[], ts.Mesh]] = {
    "quadrilateral": lambda: shaken(ts.rectangle((1.0, 1.0), (2, 2)), 0.05),
    "triangle": lambda: shaken(ts.rectangle((1.0, 1.0), (2, 2), "triangle"), 0.05),
    "hexahedron": lambda: shaken(ts.box((1.0, 1.0, 1.0), (2, 1, 1)), 0.05),
    "tetrahedron": lambda: shaken(ts.box((1.0, 1.0, 1.0), (1, 1, 1), "tetrahedron"), 0.05),
    "plane of two": lambda: plane_of_two((3.0, 1.0), (3, 2)),
    "solid of four": solid_of_four,
}


def deformed(mesh: ts.Mesh, nodes: Floats, share: float = 0.0) -> Floats:
    """Positions at which the first of `families_of` is in tension, the second in compression."""
    random = np.random.default_rng(3)
    F = np.array([[1.3, 0.1, 0.05], [0.05, 0.85, 0.1], [0.0, -0.1, 0.95]])[: mesh.dim, : mesh.dim]
    return np.asarray(nodes @ F.T + random.uniform(-share, share, nodes.shape))


def families_of(mesh: ts.Mesh) -> list[tuple[float, ...]]:
    return [(1.0, 0.4), (0.3, -1.0)] if mesh.dim == 2 else [(1.0, 0.4, 0.2), (0.2, -1.0, 0.3)]


@pytest.mark.parametrize("kind", KINDS)
def test_under_uniform_strain_springs_and_elements_agree(kind: str) -> None:
    mesh = KINDS[kind]()
    problem = body(mesh, families_of(mesh))
    simplex = kind in ("triangle", "tetrahedron")
    plain = body(mesh, families_of(mesh), k1=0.0)
    models = {"gaussian": MODELS["gaussian"], "fem": MODELS["fem"]}
    for pair in (models, SECOND_ORDER) if simplex else (models,):
        potentials = [model.potential(problem) for model in pair.values()]
        x = deformed(mesh, potentials[0].nodes)
        one, two = (potential.gradient(x) for potential in potentials)
        bare = pair["fem"].potential(plain).gradient(x)
        assert np.abs(two - bare).max() > 0.1 * np.abs(two).max()
        assert one == pytest.approx(two, abs=1e-12 * np.abs(two).max())
        energies = [potential.energy(x) for potential in potentials]
        assert energies[0] == pytest.approx(energies[1], rel=1e-12)
        fields = [potential.cell_fields(x)["stress"][-len(mesh.elements) :] for potential in potentials]  # type: ignore[attr-defined]
        assert fields[0] == pytest.approx(fields[1], abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_and_frame_invariance_at_a_deformed_state(kind: str) -> None:
    """Central differences of energy and gradient have second order; a rotation leaves the energy."""
    mesh = KINDS[kind]()
    problem = body(mesh, families_of(mesh))
    models = [*MODELS.values(), *(SECOND_ORDER.values() if kind in ("triangle", "tetrahedron") else ())]
    if kind in ("triangle", "tetrahedron", "plane of two", "solid of four"):
        models.remove(MODELS["mean dilatation"])
    for model in models:
        potential = model.potential(problem)
        x = deformed(mesh, potential.nodes, 0.01)
        way = np.random.default_rng(4).normal(size=x.shape)
        slope, image = (potential.gradient(x) * way).sum(), (potential.hessian(x) @ way.ravel()).reshape(x.shape)
        assert abs(slope) > 1e-3 and np.linalg.norm(image) > 1e-3
        errors = []
        for step in (4e-4, 2e-4):
            ahead, behind = x + step * way, x - step * way
            by_energy = abs((potential.energy(ahead) - potential.energy(behind)) / (2 * step) - slope)
            change = (potential.gradient(ahead) - potential.gradient(behind)) / (2 * step)
            errors.append([by_energy, float(np.linalg.norm(change - image))])
        assert np.log2(np.divide(*errors)) == pytest.approx([2, 2], abs=0.1)
        turn = np.linalg.qr(np.random.default_rng(8).normal(size=(mesh.dim, mesh.dim)))[0]
        turn *= np.sign(np.linalg.det(turn)) ** (np.arange(mesh.dim) == 0)
        assert potential.energy(x @ turn.T) == pytest.approx(potential.energy(x), rel=1e-12)
        assert potential.gradient(x @ turn.T) == pytest.approx(potential.gradient(x) @ turn.T, abs=1e-11)


@pytest.mark.parametrize("law", [name for name, law in LAWS.items() if law.finite])
def test_fibres_add_the_same_to_every_law(law: str) -> None:
    mesh = ts.box((1.0, 1.0, 1.0), (1, 1, 1))
    constants = {name: constant.example for name, constant in LAWS[law].constants.items()}
    with_fibres = body(mesh, families_of(mesh))
    assert with_fibres.material is not None
    x = deformed(mesh, mesh.nodes)

    def force(fibres: ts.Fibres | None) -> Floats:
        material = ts.Material(YOUNG, POISSON, 1.0, constants, fibres)
        problem = ts.Problem(mesh, material, supports=[ts.Fixed("left")], loads=[ts.Gravity((1.0, 0.0, 0.0))])
        return ts.Fem(law, "linear").potential(problem).gradient(x)

    added = force(with_fibres.material.fibres) - force(None)
    neo = MODELS["fem"].potential(with_fibres).gradient(x)
    neo -= MODELS["fem"].potential(body(mesh, families_of(mesh), k1=0.0)).gradient(x)
    assert np.abs(added).max() > 0.01 and added == pytest.approx(neo, abs=1e-9 * max(1.0, np.abs(force(None)).max()))


def test_an_active_tension_on_second_order_elements_has_the_same_work() -> None:
    """Of uniform strain: T V (stretch - 1), summed over both families, on all nodes of ten-node tetrahedra."""
    mesh = KINDS["tetrahedron"]()
    problem = body(mesh, families_of(mesh), loads=[ts.ActiveTension(2.0)])
    finer = SECOND_ORDER["fem"].potential(problem)
    for nodes, loading in ((mesh.nodes, problem.loading), (finer.nodes, finer.loading)):  # type: ignore[attr-defined]
        (load,) = loading.following
        F = np.linalg.lstsq(nodes, deformed(mesh, nodes), rcond=None)[0].T
        stretch = [np.linalg.norm(F @ a) / np.linalg.norm(a) for a in np.array(families_of(mesh))]
        assert load.energy(nodes @ F.T) == pytest.approx(2.0 * mesh.measures.sum() * (sum(stretch) - 2), rel=1e-12)


# --- directions ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["quad", "hexahedron", "triangle", "tetra", "wedge", "pyramid", "tetra10"])
def test_quadrature_integrates_the_volume_and_a_stretch(name: str) -> None:
    shape = CELL_SHAPES[name]
    at, weights = quadrature(shape.base, 2)
    volume = {"quad": 1, "hexahedron": 1, "triangle": 1 / 2, "tetra": 1 / 6, "wedge": 1 / 2, "pyramid": 4 / 3}[
        shape.base
    ]
    assert weights.sum() == pytest.approx(volume, rel=1e-14)
    assert weights @ shape.shapes(at) @ shape.places == pytest.approx(weights @ at, rel=1e-13)
    along = np.array([[0.6, 0.8, 0.0][: shape.dim]])
    (form,) = square_stretch_forms(name, shape.places, np.arange(len(shape.places))[None], along)
    F = np.eye(shape.dim) + 0.1 * np.arange(shape.dim**2).reshape(shape.dim, -1)
    x = shape.places @ F.T
    assert np.einsum("ai,ab,bi", x, form, x) == pytest.approx(volume * ((F @ along[0]) ** 2).sum(), rel=1e-13)
    assert form.sum(axis=0) == pytest.approx(0, abs=1e-14)


def written(folder: Path, mesh: ts.Mesh, arrays: dict[str, Floats]) -> Path:
    file = folder / "body.vtu"
    places = np.column_stack([mesh.nodes, np.zeros(mesh.n_nodes)]) if mesh.dim == 2 else mesh.nodes
    write_vtu(file, places, mesh.cells.items(), {}, arrays)
    return file


STUDY = """
[mesh]
file = "body.vtu"
[material]
young = "15 kPa"
poisson = 0.45
fibres = { FIBRES }
[section]
kind = "plane-stress"
thickness = "5 mm"
[[support]]
on = "left"
[[load]]
tension = "8 kPa"
[models.springs]
kind = "springs"
rule = "gaussian"
"""


def study_of(folder: Path, fibres: str, text: str = STUDY) -> Path:
    file = folder / "study.toml"
    file.write_text(text.replace("FIBRES", fibres), encoding="utf-8")
    return file


def test_directions_are_read_from_a_cell_array(tmp_path: Path) -> None:
    """Normalised, of elements in the file's order, and kept by refinement and by parts of the mesh."""
    mesh = ts.rectangle((1.0, 1.0), (2, 2))
    vectors = np.column_stack([np.arange(1.0, 5.0), np.ones(4), np.zeros(4)])
    written(tmp_path, mesh, {"fibre": vectors, "size": np.arange(4.0)})
    problem = read_study(study_of(tmp_path, 'along = "fibre", k1 = "5 kPa", k2 = 10')).problem
    assert problem.fibres is not None and problem.material is not None and problem.material.fibres is not None
    assert (problem.material.fibres.k1, problem.material.fibres.k2) == (5e3, 10)
    unit = vectors[:, :2] / np.linalg.norm(vectors, axis=1)[:, None]
    assert problem.fibres.directions == pytest.approx(unit[None])
    assert list(problem.mesh.element_vectors) == ["fibre"]
    finer = refined(problem.mesh)
    for child, vector in zip(finer.centres, finer.element_vectors["fibre"], strict=True):
        assert vector == pytest.approx(vectors[np.linalg.norm(mesh.centres - child, axis=1).argmin()])
    part = sample(problem, np.array([2, 0]))
    assert part.fibres is not None and part.fibres.directions == pytest.approx(unit[None, [2, 0]])


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("along = [3, 4]", [(0.6, 0.8)]),
        ("along = [[3, 4], [0, -2]]", [(0.6, 0.8), (0, -1)]),
        ('angle = "90 deg"', [(0, 1)]),
        ('angle = ["60 deg", "-60 deg"]', [(0.5, 0.75**0.5), (0.5, -(0.75**0.5))]),
    ],
)
def test_directions_of_a_study(tmp_path: Path, given: str, expected: list[tuple[float, float]]) -> None:
    written(tmp_path, ts.rectangle((1.0, 1.0), (2, 1)), {})
    problem = read_study(study_of(tmp_path, given)).problem
    assert problem.fibres is not None
    assert problem.fibres.directions == pytest.approx(np.array(expected)[:, None].repeat(2, axis=1), abs=1e-15)


def test_regions_have_fibres_of_their_own() -> None:
    mesh = ts.rectangle((2.0, 1.0), (2, 1))
    other = ts.Material(YOUNG, POISSON, fibres=ts.Fibres([(0.0, 2.0), (1.0, 0.0)], 7.0, 8.0))
    problem = replace(body(mesh, (1.0, 1.0)), regions=[ts.Region([1], other)])  # type: ignore[arg-type]
    fibres = problem.fibres
    assert fibres is not None and fibres.k1.tolist() == [K1, 7.0] and fibres.k2.tolist() == [K2, 8.0]
    assert fibres.directions == pytest.approx(np.array([[[0.5**0.5] * 2, [0, 1]], [[0, 0], [1, 0]]]))
    assert hash(other) == hash(replace(other)) and other != problem.material
    assert [twin.fibres for twin in (*problem.homogeneous, *body(mesh, (1.0, 0.0)).homogeneous)] == [None] * 3


# --- errors -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("along", "named"),
    [((0.0, 0.0), "0.0"), ((), "along"), ((1.0,), "along"), ([(1.0, 0.0), 3], "3"), ((np.nan, 1.0), "nan")],
)
def test_a_direction_without_length_is_an_error(along: object, named: str) -> None:
    with pytest.raises(ProblemError, match=named):
        ts.Fibres(along)  # type: ignore[arg-type]


@pytest.mark.parametrize("constant", ["k1", "k2"])
@pytest.mark.parametrize("value", [-1.0, np.inf, np.nan])
def test_impossible_constants_are_errors(constant: str, value: float) -> None:
    with pytest.raises(ProblemError, match=constant):
        ts.Fibres((1.0, 0.0), **{constant: value})


def test_an_increase_of_no_stiffness_is_an_error() -> None:
    with pytest.raises(ProblemError, match="k2 = 3 requires k1 above 0: set k1, or remove k2"):
        ts.Fibres((1.0, 0.0), k2=3.0)
    zero = fibre_energy(np.array([0.5, 40.0]), np.zeros(2), np.full(2, 5.0))
    assert not np.any(zero)


def test_an_angle_in_space_is_an_error(tmp_path: Path) -> None:
    written(tmp_path, ts.box((1.0, 1.0, 1.0), (1, 1, 1)), {})
    solid = STUDY.replace('[section]\nkind = "plane-stress"\nthickness = "5 mm"\n', "")
    place = r"study.toml:4: material: fibres: angle is for plane bodies: set along, such as along = \[1, 0, 0\]"
    with pytest.raises(StudyError, match=place):
        read_study(study_of(tmp_path, "angle = 0.5", solid))
    region = solid.replace("fibres = { FIBRES }\n", "").replace("[[support]]", REGION + "[[support]]")
    with pytest.raises(StudyError, match=place.replace("4: material", "7: region.1")):
        read_study(study_of(tmp_path, "angle = 0.5", region))


REGION = """[[region]]
on = { box = [[-1, -1, -1], [2, 2, 2]] }
young = "15 kPa"
poisson = 0.45
fibres = { FIBRES }
"""


def test_directions_that_a_mesh_lacks_are_errors() -> None:
    mesh = ts.rectangle((2.0, 1.0), (2, 1))
    arrays = {"fibre": np.array([[1.0, 0.0], [0.0, 0.0]]), "out": np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 1.0]])}
    mesh = replace(mesh, element_vectors=arrays)
    with pytest.raises(ProblemError, match=r"did you mean 'fibre'.*fibre, out"):
        body(mesh, "fibrs")
    for name in arrays:
        with pytest.raises(ProblemError, match=f"'{name}'.*element 1 "):
            body(mesh, name)
    with pytest.raises(ProblemError, match="3 numbers"):
        body(mesh, (1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("fibres", "place"),
    [
        ('along = "other"', "study.toml:4: material.*: fibre$"),
        ("along = [0, 0]", "study.toml:4: material"),
        ("along = [1, 0, 0]", "study.toml:4: material"),
        ("k1 = 1.0", "study.toml:7: material.fibres.*along"),
        ("along = 3", "study.toml:7: material.fibres.along"),
        ("along = [1, 0], angle = 0.0", "study.toml:7: material.fibres"),
        ("angle = []", r"study.toml:7: material.fibres: angle = \[\]: give an angle"),
        ("along = [1, 0], k2 = 3", "study.toml:4: material: fibres: k2 = 3 requires k1 above 0"),
    ],
)
def test_errors_of_a_study_name_their_place(tmp_path: Path, fibres: str, place: str) -> None:
    written(tmp_path, ts.rectangle((1.0, 1.0), (2, 1)), {"fibre": np.ones((2, 3))})
    with pytest.raises(StudyError, match=place):
        read_study(study_of(tmp_path, fibres))


def test_an_active_tension_without_fibres_is_an_error(tmp_path: Path) -> None:
    mesh = ts.rectangle((2.0, 1.0), (2, 1))
    plain = ts.Material(YOUNG, POISSON)
    whole = body(mesh, (1.0, 0.0))
    with pytest.raises(ProblemError, match="fibres"):
        replace(whole, material=plain)
    regions = [ts.Region([1], plain)]  # type: ignore[arg-type]
    assert len(replace(whole, regions=regions).loading.following) == 1  # on the elements with fibres
    with pytest.raises(ProblemError, match="element 1:"):
        replace(whole, regions=regions, loads=[ts.ActiveTension(1.0, on=[0, 1])])  # type: ignore[arg-type]
    written(tmp_path, mesh, {})
    text = STUDY.replace("fibres = { FIBRES }\n", "")
    with pytest.raises(StudyError, match=r"study.toml:12: load\.1: "):
        read_study(study_of(tmp_path, "", text))


OTHERS: dict[str, Model] = {
    **{f"rule {rule}": ts.Springs(rule) for rule in ts.RULES},
    "prescribed": ts.Springs(stiffness=ts.UserStiffness(0.3, 0.3)),
    "linear": ts.Fem("linear"),
    "heml": ts.Heml("neo-hookean"),
    "mass-tensor": ts.MassTensor("saint-venant-kirchhoff"),
    "terzopoulos": ts.Terzopoulos(),
    "calculix": ts.CalculiX(),
}


ON_TRIANGLES = ("rule van-gelder", "heml", "mass-tensor")


@pytest.mark.parametrize("name", OTHERS)
def test_no_model_ignores_fibres(name: str) -> None:
    """A model includes their stiffness or raises, and takes fibres that only give the direction of a tension.

    CalculiX has no load that follows the fibres.
    """
    mesh = ts.rectangle((1.0, 1.0), (2, 2), "triangle" if name in ON_TRIANGLES else "quadrilateral")
    model = OTHERS[name]
    problem = body(mesh, (1.0, 0.0), supports=[ts.Fixed("left")])
    assert model.takes_fibres == (name == "rule gaussian")
    if model.takes_fibres:
        assert ts.solve(problem, model).status is ts.Status.CONVERGED
        return
    with pytest.raises(ModelError, match="fibres"):
        ts.solve(problem, model)
    without = body(mesh, (1.0, 0.0), k1=0.0, supports=[ts.Fixed("left")], loads=[ts.ActiveTension(0.01)])
    if name == "calculix":
        with pytest.raises(ts.TruespringError, match=r"active tension.* follows the body, and there is no keyword"):
            ts.solve(without, model)
        return
    assert ts.solve(without, model).states[-1].displacement[:, 0].min() < 0


def test_an_active_tension_inside_a_block_of_boundary_elements_is_an_error() -> None:
    mesh = ts.rectangle((4.0, 2.0), (8, 4))
    left, right = (np.flatnonzero(side) for side in (mesh.centres[:, 0] < 2, mesh.centres[:, 0] > 2.5))
    tension = ts.ActiveTension(1e-3, on=left)  # type: ignore[arg-type]
    problem = body(mesh, (1.0, 0.0), k1=0.0, loads=[tension], supports=[ts.Fixed("left")])
    with pytest.raises(ModelError, match="inside"):
        ts.BemSprings(block=left).potential(problem)  # type: ignore[arg-type]
    assert ts.solve(problem, ts.BemSprings(block=right)).status is ts.Status.CONVERGED  # type: ignore[arg-type]


def test_exports_do_not_leave_fibres_out(tmp_path: Path) -> None:
    pull, left = ts.Force("right", (0.01, 0.0)), ts.Fixed("left")
    problem = body(ts.rectangle((1.0, 1.0), (2, 2)), (1.0, 0.0), loads=[pull], supports=[left])
    for name, target in TARGETS.items():
        with pytest.raises(ts.TruespringError, match="fibres"):
            ts.export(problem, ts.Springs("isotropic"), name, tmp_path)
        if Feature.PRESSURE not in target.takes:
            with pytest.raises(ts.TruespringError, match="pressure"):
                ts.export(problem, ts.Springs("gaussian"), name, tmp_path)
    with pytest.raises(ts.TruespringError, match="fibres"):
        fem_deck(problem, [1.0], "saint-venant-kirchhoff")


def test_moduli_are_those_of_the_material_between_the_fibres() -> None:
    problem = body(ts.rectangle((4.0, 1.0), (8, 2)), (1.0, 0.0), k1=50.0)
    pull, left = ts.Force("right", (0.01, 0.0)), ts.Fixed("left")
    plain = ts.Problem(problem.mesh, ts.Material(YOUNG, POISSON), problem.section, left, pull)
    one, two = (ts.moduli(one, ts.Springs("gaussian")) for one in (problem, plain))
    assert one.bending == two.bending and one.young() == two.young()
