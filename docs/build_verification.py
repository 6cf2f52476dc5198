"""Rebuild docs/verification.md: every number is measured again and compared with its source.

Run from the root of the repository: python docs/build_verification.py (or make verification).
"""

import platform
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from docs.loads_and_paths import ROWS  # noqa: E402
from tests.closed_forms import bending_factor, elastica_tip, lattice_tension, material_of, principal_state  # noqa: E402
from tests.test_fem import TRUE_DEFLECTION  # noqa: E402
from tests.test_gaussian import INDEPENDENT, pulled_strip  # noqa: E402
from tests.test_moduli import JITTERED, pulled_modulus, triangulated  # noqa: E402

import truespring as ts  # noqa: E402
from truespring.mesh import in_simplices, refined  # noqa: E402
from truespring.models import GAUSSIAN_LAWS, LAWS  # noqa: E402
from truespring.report.standing import own_errors  # noqa: E402
from truespring.study import read_study, run  # noqa: E402


@dataclass(frozen=True)
class Row:
    """A measured number: description, value of truespring, reference value and its source.

    `own` is the discretisation error of finite elements, None for springs.
    """

    what: str
    measured: float
    reference: float
    source: str
    own: ts.OwnError | None = None

    def __str__(self) -> str:
        apart = abs(self.measured - self.reference) / (abs(self.reference) or 1.0)
        measured = 0.0 if not self.reference and apart < ROUNDING[0] else self.measured + 0.0
        shown = [self.what, f"{measured:.8g}", f"{self.reference:.8g}", rounded(apart), self.source]
        return f"| {' | '.join([*shown, own_limit(self.own)])} |"


#: Differences below these are rounding errors or solver tolerances, whose digits depend on the machine.
ROUNDING = (1e-12, 1e-9)


def rounded(apart: float) -> str:
    """Return a relative difference as text, those at rounding level as such."""
    below = next((level for level in ROUNDING if apart < level), None)
    return f"{apart:.1e}" if below is None else f"below {below:.0e}".replace("e-0", "e-")


def own_limit(own: ts.OwnError | None) -> str:
    """Return the discretisation error as text, empty if there is none."""
    if own is None:
        return ""
    if own.value is None:
        return "not known"
    return (
        rounded(own.value)
        if own.value < ROUNDING[-1]
        else f"{own.value:.1%}"
        if own.value > 0.001
        else f"{own.value:.2%}"
    )


def two_springs() -> Iterator[Row]:
    """Ansys verification manual VM9."""
    network = ts.SpringNetwork([[0.0, 10.0], [0.0, 0.0], [0.0, -10.0]], [[0, 1], [1, 2]], [8.0, 1.0], [10.0, 10.0])
    problem = ts.Problem(network.mesh, supports=[ts.Fixed([0, 2])], loads=[ts.Force([1], (5.0, 5.0))])
    state = ts.solve(problem, network).states[-1]
    for what, value, printed in (
        ("displacement x", state.displacement[1, 0], 8.631),
        ("displacement y", state.displacement[1, 1], 4.533),
        ("strain energy", state.energy, 24.01),
    ):
        yield Row(f"two springs, large deflection: {what}", float(value), printed, "Ansys VM9, as printed")


def tensile(stress: float, law: str = "linear") -> ts.Problem:
    """A 6 by 4 block of E = 1, with the constants of a law, under uniform tension, free to contract."""
    return ts.Problem(
        mesh=ts.rectangle((1.5, 1.0), (6, 4)),
        material=material_of(law, 1.0, 1 / 3),
        section=ts.PlaneStress(1.0),
        supports=[ts.Fixed("left", ["x"]), ts.Fixed("left-bottom")],
        loads=[ts.Force("right", (stress, 0.0))],
    )


def uniform_tension() -> Iterator[Row]:
    """Straight springs against the lattice's closed form, other models against the law's, at a stress of 0.3 E."""
    for rule, (edge, diagonal) in {"lloyd": (5 / 16, 7 / 16), "isotropic": (3 / 8, 3 / 8)}.items():
        stretch, _ = lattice_tension(0.3, (1.0, 1.0), (edge, edge), diagonal)
        state = ts.solve(tensile(0.3), ts.Springs(rule)).states[-1]
        found = 1 + float(state.displacement[:, 0].max()) / 1.5
        yield Row(f"tension 0.3 E, {rule} springs: stretch", found, stretch, "closed form of the lattice")
    models = [*((law, ts.Fem(law)) for law in LAWS), *((law, ts.Springs("gaussian", law=law)) for law in GAUSSIAN_LAWS)]
    for law, model in models:
        problem = tensile(0.3, law)
        path = ts.solve(problem, model)
        found = 1 + float(path.states[-1].displacement[:, 0].max()) / 1.5
        _, stress = principal_state(law, 1.0, 1 / 3, (found, None, None))
        own = None if model.has_springs else ts.reference_error(problem, model)
        yield Row(f"tension, {model.label}: stress at stretch {found:.6f}", 0.3, float(stress[0]), "the law", own)


def gaussian_strip() -> Iterator[Row]:
    """A strip of 16 by 4 squares of Gaussian springs, against an independent program."""
    for force, hourglass, expected in INDEPENDENT:
        _, found = pulled_strip(force, hourglass)
        axis = int(np.argmax(np.abs(expected)))
        what = f"strip, gaussian springs, force {force} N, hourglass {hourglass:.4g}: u{'xy'[axis]} [m]"
        yield Row(what, float(found[axis]), expected[axis], "an independent program, `tests/test_gaussian.py`")


def moduli() -> Iterator[Row]:
    """Young's modulus and Poisson's ratio of the unbounded lattice."""
    problem = ts.Problem(
        ts.rectangle((4.0, 1.0), (16, 4)),
        ts.Material(1.0, 1 / 3),
        ts.PlaneStress(1.0),
        [ts.Fixed("left")],
        [ts.Force("right", (1.0, 0.0))],
    )
    lloyd, bulk = (ts.moduli(problem, ts.Springs(rule)) for rule in ("lloyd", "isotropic"))
    source = "C11 = 2 a + b, C12 = C66 = b; Brisard, What is homogenization?, part 4"
    yield Row("lloyd springs: E at 0 degrees", lloyd.young(), 15 / 17, source)
    yield Row("lloyd springs: E at 45 degrees", lloyd.young(45), 21 / 19, source)
    yield Row("lloyd springs: Poisson's ratio at 0 degrees", lloyd.poisson(), 7 / 17, source)
    yield Row("lloyd springs: Zener ratio", lloyd.zener, 7 / 5, source)
    yield Row("isotropic springs: E at 30 degrees", bulk.young(30), 1.0, source)
    for depth in (1, 2, 3, 4, 8):
        wanted = bending_factor(5 / 16, 7 / 16, depth)
        yield Row(
            f"lloyd springs: bending factor, n = {depth}", lloyd.bending[depth], wanted, "sum over levels and rows"
        )


def elastica() -> Iterator[Row]:
    """Tip deflection of a cantilever L/H = 20, four elements deep, against the elastica with its EI."""
    for rule, (edge, diagonal) in {"lloyd": (5 / 16, 7 / 16), "isotropic": (3 / 8, 3 / 8)}.items():
        for alpha in (1.0, 2.0, 3.0):
            mesh = ts.rectangle((20.0, 1.0), (80, 4))
            problem = ts.Problem(
                mesh,
                ts.Material(1.0, 1 / 3),
                ts.PlaneStress(1.0),
                [ts.Fixed("left")],
                [ts.Force("right", (0.0, -alpha / 12 / 400))],
            )
            state = ts.solve(problem, ts.Springs(rule)).states[-1]
            found = -float(state.displacement[ts.named_point(mesh, "right-middle"), 1]) / 20
            wanted = elastica_tip(alpha / bending_factor(edge, diagonal, 4))[1]
            yield Row(
                f"elastica, {rule} springs, P L^2 / EI = {alpha:g}: tip", found, wanted, "Bisshopp and Drucker 1945"
            )


def body(mesh: ts.Mesh, poisson: float, section: ts.PlaneStress | ts.PlaneStrain | None = None) -> ts.Problem:
    """A body of E = 1 that is held on the left and pulled on the right."""
    section = section or (ts.PlaneStress(1.0) if mesh.dim == 2 else None)
    pull = (1.0, *(0.0,) * (mesh.dim - 1))
    return ts.Problem(mesh, ts.Material(1.0, poisson), section, [ts.Fixed("left")], [ts.Force("right", pull)])


def lattices() -> Iterator[Row]:
    """Moduli of the unbounded lattices of triangles, cubes and tetrahedra."""
    triangles = body(ts.rectangle((4.0, 2.0), (8, 4), "triangle"), 1 / 3)
    sheared = ts.rectangle((6.0, 3 * 3**0.5), (6, 6), "triangle", "left")
    skew = np.array([[1.0, 0.0], [1 / 3**0.5, 1.0]])
    equilateral = ts.Mesh(sheared.nodes @ skew, sheared.elements, "triangle")
    cubes = body(ts.box((4.0, 2.0, 2.0), (4, 2, 2)), 1 / 4)
    centred = body(ts.box((4.0, 4.0, 4.0), (4, 4, 4), "bcc-tetrahedron"), 1 / 4)
    six = body(ts.box((4.0, 4.0, 4.0), (4, 4, 4), "tetrahedron"), 1 / 4)
    fit = "least squares of the element's matrix by hand"
    homogenised = "homogenised by an independent code"
    alike = ts.Problem(
        equilateral,
        ts.Material(1.0, 1 / 3),
        ts.PlaneStress(1.0),
        [ts.Fixed(range(7))],
        [ts.Force([48], (1.0, 0.0))],
    )
    for rule in ("lloyd", "van-gelder"):
        realised = ts.moduli(alike, ts.Springs(rule))
        source = "C11 = 3 sqrt(3)/4 k, C12 = C66 = sqrt(3)/4 k of the triangular lattice"
        yield Row(f"equilateral triangles, {rule}: smallest E of all directions", realised.young_range[0], 1.0, source)
        yield Row(f"equilateral triangles, {rule}: Poisson's ratio", realised.poisson(), 1 / 3, source)
    for rule, along in {"van-gelder": (1, 1, 1 / 3), "lloyd": (3**0.5 / 2, 3**0.5, 2 * 3**0.5 / 10)}.items():
        realised = ts.moduli(triangles, ts.Springs(rule))
        for angle, wanted in zip((0, 45, -45), along, strict=True):
            yield Row(f"right triangles, {rule}: E at {angle} degrees", realised.young(angle), wanted, homogenised)
    for rule, along in {
        "least-squares": (0.726, 0.813, 0.847),
        "projected": (0.833, 1.022, 1.106),
        "isotropic": (1.0, 1.0, 1.0),
    }.items():
        realised = ts.moduli(cubes, ts.Springs(rule))
        for direction, wanted in zip(((1, 0, 0), (1, 1, 0), (1, 1, 1)), along, strict=True):
            where = " + ".join(axis for axis, part in zip("xyz", direction, strict=True) if part)
            source = "Golec et al. 2020" if rule == "isotropic" else homogenised
            yield Row(f"cubes, {rule}: E along {where}", realised.young(direction), wanted, source)
    stiffness = ts.Springs("least-squares").element_stiffness(cubes)[0]
    for what, place, wanted in (
        ("edge", 0, 29 / 350),
        ("face diagonal", 12, 188 / 1575),
        ("body diagonal", 24, 41 / 525),
    ):
        yield Row(f"cubes, least-squares: {what}, in E h", float(stiffness[place]), wanted, fit)
    for name, problem, rule, wanted_range in (
        ("body-centred-cubic tetrahedra", centred, "lloyd", (1.00794, 1.00794)),
        ("body-centred-cubic tetrahedra", centred, "van-gelder", (0.857, 1.091)),
        ("six tetrahedra a cube", six, "lloyd", (0.390, 2.855)),
    ):
        found = ts.moduli(problem, ts.Springs(rule)).young_range
        source = homogenised if problem is centred else f"{homogenised}, over sampled directions"
        for extreme, value, wanted in zip(("smallest", "largest"), found, wanted_range, strict=True):
            yield Row(f"{name}, {rule}: {extreme} E of all directions", value, wanted, source)
    for k_body, factors in {0.0: (1.80, 1.22, 1.10), 0.15: (2.25, 1.31, 1.14), 0.3: (2.40, 1.37, 1.17)}.items():
        bending = ts.moduli(cubes, ts.Springs("isotropic", k_body=k_body)).bending
        for depth, wanted in zip((1, 2, 3), factors, strict=True):
            what = f"cubes, isotropic, k_body = {k_body:g}: bending factor, {depth} by {depth}"
            yield Row(what, bending[depth], wanted, "pure bending, an independent code")


def irregular() -> Iterator[Row]:
    """Nearly equilateral triangles of about 40 by 46 nodes, shaken, in tension: E of springs and of finite elements."""
    for jitter, tabulated in JITTERED.items():
        mesh = triangulated(jitter, seed=1)
        models: list[ts.Fem | ts.Springs] = [ts.Fem("linear", "linear")]
        models += [ts.Springs(rule, allow_negative=True) for rule in ("projected", "van-gelder", "lloyd")]
        for model, wanted in zip(models, tabulated, strict=True):
            what = f"triangles, nodes moved by up to {jitter:g} of an edge, {model.label}: E"
            yield Row(what, pulled_modulus(mesh, model), wanted, "one other realisation, an independent code")


def volume_terms() -> Iterator[Row]:
    """Young's modulus and Poisson's ratio of blocks of springs with a volume term, by solving a tensile test."""
    for mesh in (ts.rectangle((2.0, 1.0), (4, 2)), ts.box((2.0, 1.0, 1.0), (4, 2, 2))):
        where = "squares, plane stress" if mesh.dim == 2 else "cubes"
        for poisson in (0.0, 0.1, 0.25, 0.4, 0.49):
            axes, small = "xyz"[: mesh.dim], 1e-6
            sides = ("left", "bottom", "back")[: mesh.dim]
            supports = [ts.Fixed(side, [axis]) for side, axis in zip(sides, axes, strict=True)]
            loads = [ts.Force("right", (small, *(0.0,) * (mesh.dim - 1)))]
            section = ts.PlaneStress(1.0) if mesh.dim == 2 else None
            problem = ts.Problem(mesh, ts.Material(1.0, poisson), section, supports, loads)
            path = ts.solve(problem, ts.Springs("isotropic", volume=True), ts.Newton(load_steps=1))
            strain = path.states[-1].displacement.max(axis=0)[0] / 2
            across = -path.states[-1].displacement[:, 1].min()
            yield Row(f"{where}, volume term: E, poisson = {poisson:g}", small / strain, 1.0, "the material")
            yield Row(f"{where}, volume term: Poisson's ratio", float(across / strain), poisson, "the material")


def biquadratic_springs() -> Iterator[Row]:
    """Biquadratic springs against St. Venant-Kirchhoff finite elements, far from rest."""
    generator = np.random.default_rng(3)
    for mesh in (
        ts.rectangle((2.0, 1.0), (2, 1), "triangle"),
        ts.rectangle((2.0, 1.0), (2, 1)),
        ts.box((2.0, 1.0, 1.0), (2, 1, 1), "tetrahedron"),
        ts.box((2.0, 1.0, 1.0), (2, 1, 1)),
    ):
        moved = mesh.nodes + generator.uniform(-0.1, 0.1, mesh.nodes.shape)
        problem = ts.Problem(
            ts.Mesh(moved, mesh.elements, mesh.element),
            ts.Material(1.0, 0.3),
            ts.PlaneStress(1.0) if mesh.dim == 2 else None,
            [ts.Fixed(range(mesh.dim + 1))],
            [ts.Force([mesh.n_nodes - 1], (1.0,) * mesh.dim)],
        )
        springs = ts.Springs("biquadratic").potential(problem)
        elements = ts.Fem("saint-venant-kirchhoff", "linear").potential(problem)
        positions = moved @ generator.normal(size=(mesh.dim, mesh.dim)) + generator.uniform(-0.2, 0.2, moved.shape)
        for what, mine, theirs in (
            ("energy", springs.energy(positions), elements.energy(positions)),
            ("force", springs.gradient(positions), elements.gradient(positions)),
            ("tangent", springs.hessian(positions).toarray(), elements.hessian(positions).toarray()),
        ):
            apart = np.abs(np.asarray(mine) - theirs).max() / np.abs(theirs).max()
            yield Row(
                f"biquadratic springs, {mesh.element}: {what} against FEM", float(apart), 0.0, "the same function"
            )


def cook_mesh(n: int, element: str = "quadrilateral", diagonal: str = "right") -> ts.Mesh:
    """Cook's membrane of n by n quadrilaterals, or twice as many triangles."""
    unit = ts.rectangle((1.0, 1.0), (n, n), element, diagonal)
    s, t = unit.nodes.T
    return ts.Mesh(np.stack([48 * s, 44 * s + t * (44 - 28 * s)], axis=1), unit.elements, element)


def cook_problem(mesh: ts.Mesh, load: float) -> ts.Problem:
    """Cook's membrane in plane stress, E = 1, nu = 1/3."""
    loads = [ts.Force("right", (0.0, load))]
    return ts.Problem(mesh, ts.Material(1.0, 1 / 3), ts.PlaneStress(1.0), [ts.Fixed("left")], loads)


def cook_tip(mesh: ts.Mesh, model: ts.Springs | ts.Fem) -> float:
    """Deflection at (48, 52) of Cook's membrane under a unit load; linearised."""
    small = 1.0 if isinstance(model, ts.Fem) else 1e-6
    state = ts.solve(cook_problem(mesh, small), model, ts.Newton(load_steps=1)).states[-1]
    return float(state.displacement[ts.nearest_node(mesh, (48.0, 52.0)), 1]) / small


def cook() -> Iterator[Row]:
    """Cook's membrane, linear, by finite elements."""
    source = "an independent four-node code; converged 23.97, FinEtools tutorial"
    for n, wanted in ((8, 22.0792), (16, 23.4304), (32, 23.8176), (64, 23.9245), (128, 23.9548)):
        found = cook_tip(cook_mesh(n), ts.Fem("linear"))
        own = ts.reference_error(cook_problem(cook_mesh(n), 1.0), ts.Fem("linear"), ts.Newton(load_steps=1))
        yield Row(f"Cook's membrane, linear FEM, n = {n}: tip", found, wanted, source, own)
    mesh, model = cook_mesh(32, "triangle"), ts.Fem("linear", "quadratic")
    own = ts.reference_error(cook_problem(mesh, 1.0), model, ts.Newton(load_steps=1))
    what = "Cook's membrane, quadratic triangles, n = 32: tip"
    yield Row(what, cook_tip(mesh, model), 23.97, "FinEtools tutorial", own)


def cook_springs() -> Iterator[Row]:
    """Cook's membrane by springs on triangles: inaccurate results, as predicted by the effective moduli."""
    for diagonal, tips in {"right": (45.338, 18.088), "left": (33.341, 15.938)}.items():
        for rule, wanted in zip(("van-gelder", "lloyd"), tips, strict=True):
            found = cook_tip(cook_mesh(64, "triangle", diagonal), ts.Springs(rule))
            what = f"Cook's membrane, {rule} springs on triangles, n = 64, diagonal {diagonal}: tip"
            yield Row(what, found, wanted, "an independent code; the converged value is 23.97")


def locking() -> Iterator[Row]:
    """A cantilever of 20 by 5 by 5 hexahedra under a small end load, compared with the limit of refined elements."""
    mesh = ts.box((4.0, 1.0, 1.0), (20, 5, 5))
    source = "extrapolated from refined elements of both kinds that do not lock, `tests/test_fem.py`"
    for poisson, limit in TRUE_DEFLECTION.items():
        for label, model in (
            ("hexahedra of mean dilatation", ts.Fem("linear", "mean-dilatation")),
            ("linear hexahedra, which lock", ts.Fem("linear", "linear")),
            ("springs with a volume term", ts.Springs("isotropic", volume=True)),
        ):
            loads = [ts.Force("right", (0.0, -1e-7, 0.0))]
            problem = ts.Problem(mesh, ts.Material(1.0, poisson), None, [ts.Fixed("left")], loads)
            state = ts.solve(problem, model, ts.Newton(load_steps=1)).states[-1]
            tip = -float(state.displacement[ts.named_point(mesh, "right-middle"), 1])
            what = f"20 x 5 x 5 {label}, poisson = {poisson:g}: deflection over P L^3 / 3 E I"
            once = ts.Newton(load_steps=1)
            own = ts.reference_error(problem, model, once) if isinstance(model, ts.Fem) else None
            yield Row(what, tip / (1e-7 * 4**3 / 3 * 12), limit, source, own)


def loads_and_paths() -> Iterator[Row]:
    """Loads that follow, limit points, buckling."""
    for make in ROWS:
        for found in make():
            yield Row(*found)


def shipped_studies() -> str:
    """Errors in the shipped studies, including the two findings of Lembryk and Ciszkiewicz."""
    errors = "error at the probe | rms error | largest error"
    lines = [
        f"| study | springs | reference | {errors} | error of the reference | error against the refined reference |"
    ]
    lines.append("|---|---|---|---|---|---|---|---|")
    for name in ("stretching", "bending", "soft_block", "tissue"):
        result = run(read_study(ROOT / "examples" / f"{name}.toml"))
        for reference, one in result.comparisons.items():
            errors = (one.probe_error, one.rms_error, one.max_error)
            shown = [f"{error:.2%}" for error in errors if error is not None] + list(own_errors(result, reference))
            lines.append(f"| {name} | {one.model.label} | {one.reference.label} | {' | '.join(shown)} |")
    return "\n".join(lines)


def against_the_truth() -> str:
    """Springs of the shipped studies in the plane against each law refined: the table of docs/accuracy/studies.md.

    The refined elements are of second order on a mesh refined twice. Four-node elements on the mesh of the springs are
    included for comparison.
    """
    lines = ["| against, refined | stretched by 30 % | bent by half the length |", "|---|---|---|"]
    found: dict[str, list[str]] = {}
    for name in ("stretching", "bending"):
        study = read_study(ROOT / "examples" / f"{name}.toml")
        problem, steps = study.problem, study.solver
        mesh = refined(refined(in_simplices(problem.mesh)[0]))
        for law in (name for name, entry in LAWS.items() if not entry.constants):
            truth = ts.solve(replace(problem, mesh=mesh), ts.Fem(law), steps)
            models = {f"springs ({rule})": ts.Springs(rule) for rule in ("lloyd", "isotropic", "gaussian")}
            for who, model in {**models, "four-node elements": ts.Fem(law)}.items():
                error = ts.compare(ts.solve(problem, model, steps), truth).error
                shown = "no equilibrium" if error is None else f"{error:.1%}"
                found.setdefault(f"{who}: {ts.Fem(law).label}", []).append(shown)
    order = sorted(found, key=lambda one: one.split(":")[0])
    return "\n".join(lines + [f"| {name} | {' | '.join(found[name])} |" for name in order])


HEAD = """\
# Verification

`make verification` measures the numbers on this page and rebuilds it
({versions});
tests check the differences from CalculiX.

Springs are compared with the theory of spring lattices, finite elements with their constitutive law. The differences
between springs and FEM in the last tables are not errors of truespring but properties of the models. For finite
elements, the last column is the discretisation error: the rms difference at the nodes from the limit of mesh
refinement ([definition](study.md#error-of-a-reference)).
"""


LOCKING = """\
Linear hexahedra reach 0.922 of the limit at Poisson's ratio 0.45 and 0.791 at 0.49 (checked by `tests/test_fem.py`). An
independent code gives 0.937 and 0.819 relative to a different limit; these values are not reproduced.
"""


CALCULIX = """\
## CalculiX

The same bodies, nodes and loads are solved by CalculiX 2.20 (`tests/test_calculix.py`, if `ccx` is installed). The
table lists the largest nodal difference over the largest displacement or, where it says "tip", the relative difference
of the tip displacement.

| body | largest difference |
|---|---|
| plane strain (CPE4), linear and NLGEOM, bending and stretching | 1e-6 |
| plane stress as CPE4 with exchanged constants, linear and NLGEOM | 1e-6 |
| plane stress (CPS4, expanded to solids there), bending, tip, thickness H/4 and H/20 | 6e-3 and 2.5e-3 |
| the same, stretching, tip | 1e-4 and 5e-5 |
| spring lattices (SPRINGA), plane and in space, bending, stretching, prescribed motion | 1e-6 |
| hexahedra (C3D8), tetrahedra (C3D4, C3D10), linear and NLGEOM, bending, tension, torsion, rms | 1e-6 |
| pyramids (as C3D8), triangles with quadrilaterals (CPE3, CPE4), linear and NLGEOM, rms | 1e-6 |
| wedges (as C3D8) and solids of four kinds, tension and pressure, linear, NLGEOM, rms | 1e-6, 1e-5 |
| pressure that follows, gravity, traction, twisted ends, linear and NLGEOM, plane strain and in space | 1e-3 |
| the shipped organ, linear and NLGEOM under 0.3 of its loads, Poisson's ratio 0.3 (`make verification`) | 1e-3 |
"""


def page() -> str:
    """Return the whole page."""
    versions = ", ".join(f"{name} {version(name)}" for name in ("truespring", "numpy", "scipy", "scikit-fem"))
    parts = [HEAD.format(versions=f"Python {platform.python_version()}, {versions}")]
    for title, rows in (
        ("Springs", (two_springs, uniform_tension, moduli, lattices, irregular, elastica)),
        ("Any Poisson's ratio", (gaussian_strip, volume_terms, biquadratic_springs)),
        ("Inaccurate springs, as predicted by their effective moduli", (cook_springs,)),
        ("Loads and paths past limit points", (loads_and_paths,)),
        ("Finite elements", (cook, locking)),
    ):
        table = [
            "| quantity | truespring | reference | difference | source | discretisation error |",
            "|---|---|---|---|---|---|",
        ]
        table += [str(row) for make in rows for row in make()]
        parts.append(f"## {title}\n\n" + "\n".join(table) + "\n")
    parts.append(LOCKING)
    parts.append(CALCULIX)
    parts.append(
        "## Springs and FEM on the same body\n\nThe shipped studies at full load, with all models of a study on one "
        "mesh: 16 x 4 squares, 20 x 5 x 5 cubes, 4142 tetrahedra from a file. Errors are against the reference on that "
        "mesh; in the last column, against the refined reference.\n\n" + shipped_studies() + "\n"
    )
    parts.append(
        "The rms errors of the plane studies against second-order triangles on a mesh refined twice. For comparison, "
        "the table includes the four-node elements on the mesh of the springs.\n\n" + against_the_truth() + "\n"
    )
    return "\n".join(parts)


if __name__ == "__main__":
    (Path(__file__).parent / "verification.md").write_text(page(), encoding="utf-8")
