"""Rebuild docs/verification.md: every number measured anew and set beside its source.

Run from the root of the repository: python docs/build_verification.py (or make verification).
"""

import platform
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from tests.closed_forms import bending_factor, elastica_tip, lattice_tension, principal_state  # noqa: E402

import truespring as ts  # noqa: E402
from truespring.models import LAWS  # noqa: E402
from truespring.study import read_study, run  # noqa: E402


@dataclass(frozen=True)
class Row:
    """One number: what it is, what truespring gives, what the source says, and which source."""

    what: str
    measured: float
    wanted: float
    source: str

    def __str__(self) -> str:
        apart = abs(self.measured - self.wanted) / (abs(self.wanted) or 1.0)
        return f"| {self.what} | {self.measured:.8g} | {self.wanted:.8g} | {apart:.1e} | {self.source} |"


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


def block(rule: str, law: str | None, stress: float, poisson: float = 1 / 3) -> ts.State:
    """A 6 by 4 block of E = 1 under uniform tension, free to contract."""
    problem = ts.Problem(
        mesh=ts.rectangle((1.5, 1.0), (6, 4)),
        material=ts.Material(1.0, poisson),
        section=ts.PlaneStress(1.0),
        supports=[ts.Fixed("left", ["x"]), ts.Fixed("left-bottom")],
        loads=[ts.Force("right", (stress, 0.0))],
    )
    return ts.solve(problem, ts.Fem(law) if law else ts.Springs(rule)).states[-1]


def uniform_tension() -> Iterator[Row]:
    """Springs against the lattice's closed form, FEM against its law's, at a nominal stress of 0.3 E (Hencky too)."""
    for rule, (edge, diagonal) in {"lloyd": (5 / 16, 7 / 16), "isotropic": (3 / 8, 3 / 8)}.items():
        stretch, _ = lattice_tension(0.3, (1.0, 1.0), (edge, edge), diagonal)
        found = 1 + float(block(rule, None, 0.3).displacement[:, 0].max()) / 1.5
        yield Row(f"tension 0.3 E, {rule} springs: stretch", found, stretch, "closed form of the lattice")
    for law in LAWS:
        found = 1 + float(block("", law, 0.3).displacement[:, 0].max()) / 1.5
        _, stress = principal_state(law, 1.0, 1 / 3, (found, None, None))
        yield Row(f"tension, {LAWS[law].label}: stress at stretch {found:.6f}", 0.3, float(stress[0]), "the law itself")


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


def cook_mesh(n: int) -> ts.Mesh:
    """Cook's membrane of n by n quadrilaterals."""
    unit = ts.rectangle((1.0, 1.0), (n, n))
    s, t = unit.nodes.T
    return ts.Mesh(np.stack([48 * s, 44 * s + t * (44 - 28 * s)], axis=1), unit.elements)


def cook() -> Iterator[Row]:
    """Cook's membrane, linear, plane stress, E = 1, nu = 1/3."""
    for n, wanted in ((8, 22.0792), (16, 23.4304), (32, 23.8176), (64, 23.9245), (128, 23.9548)):
        mesh = cook_mesh(n)
        problem = ts.Problem(
            mesh,
            ts.Material(1.0, 1 / 3),
            ts.PlaneStress(1.0),
            [ts.Fixed("left")],
            [ts.Force("right", (0.0, 1.0))],
        )
        state = ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=1)).states[-1]
        found = float(state.displacement[ts.nearest_node(mesh, (48.0, 52.0)), 1])
        source = "an independent four-node code; converged 23.97, FinEtools tutorial"
        yield Row(f"Cook's membrane, linear FEM, n = {n}: tip", found, wanted, source)


def shipped_studies() -> str:
    """The two findings of Lembryk and Ciszkiewicz, as the shipped studies show them."""
    lines = ["| study | reference | error at the probe | rms error | largest error |", "|---|---|---|---|---|"]
    for name in ("stretching", "bending"):
        result = run(read_study(ROOT / "examples" / f"{name}.toml"))
        for one in result.comparisons.values():
            errors = (one.probe_error, one.rms_error, one.max_error)
            lines.append(f"| {name} | {one.reference.label} | " + " | ".join(f"{error:.2%}" for error in errors) + " |")
    return "\n".join(lines)


HEAD = """\
# Verification

The numbers on this page are measured by `make verification`, which rebuilds it
({versions});
the limits against CalculiX are held by tests.

The gap between springs and FEM is a measurement, not a test: it is in the last table. What is tested is that
the springs do what a lattice of springs must, and the finite elements what their law says.
"""


CALCULIX = """\
## CalculiX

The same bodies, nodes and loads in CalculiX 2.20, held by `tests/test_calculix.py` where `ccx` is installed;
largest nodal distance over largest displacement, or distance at the tip over its displacement:

| twin | difference at most |
|---|---|
| plane strain (CPE4), linear and NLGEOM, bending and stretching | 1e-6 |
| plane stress as CPE4 with exchanged constants, linear and NLGEOM | 1e-6 |
| plane stress (CPS4, expanded to solids there), bending, tip, thickness H/4 and H/20 | 6e-3 and 2.5e-3 |
| the same, stretching, tip | 1e-4 and 5e-5 |
| spring lattices (SPRINGA), bending, stretching, prescribed motion | 1e-6 |
"""


def page() -> str:
    """Return the whole page."""
    versions = ", ".join(f"{name} {version(name)}" for name in ("truespring", "numpy", "scipy", "scikit-fem"))
    parts = [HEAD.format(versions=f"Python {platform.python_version()}, {versions}")]
    for title, rows in (
        ("Springs", (two_springs, uniform_tension, moduli, elastica)),
        ("Finite elements", (cook,)),
    ):
        table = ["| what | truespring | reference | apart | source |", "|---|---|---|---|---|"]
        table += [str(row) for make in rows for row in make()]
        parts.append(f"## {title}\n\n" + "\n".join(table) + "\n")
    parts.append(CALCULIX)
    parts.append(
        "## What springs and FEM make of the same body\n\nThe shipped studies at full load, springs by Lloyd's rule, "
        "16 x 4 squares, all models on the same mesh:\n\n" + shipped_studies() + "\n"
    )
    return "\n".join(parts)


if __name__ == "__main__":
    (Path(__file__).parent / "verification.md").write_text(page(), encoding="utf-8")
