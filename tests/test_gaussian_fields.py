"""Fields and pictures of Gaussian springs: what VTU files, figures and pages show of them."""

from pathlib import Path

import meshio
import numpy as np
import pytest

import truespring as ts
from tests.studies import changed, written
from tests.test_export_gaussian import BODIES, solved
from truespring.cli import main
from truespring.models.gaussian import GaussianElements, SummedGaussian
from truespring.models.gaussian_quadratic import GaussianQuadratic
from truespring.report.series import write_series


@pytest.mark.parametrize("body", BODIES)
def test_fields_of_lines_and_elements(body: str, tmp_path: Path) -> None:
    path = solved(body).path
    potential, state = path.potential, path.states[-1]
    assert isinstance(potential, GaussianElements | SummedGaussian | GaussianQuadratic)
    write_series(path, tmp_path, "body")
    rest, last = (meshio.read(tmp_path / "body" / f"body_{number:04d}.vtu") for number in (0, 1))
    lines = last.cells_dict["line"]
    kinds = [block.type for block in last.cells]
    assert kinds[0] == "line" and sum(len(block) for block in last.cells[1:]) == len(path.problem.mesh.elements)
    fields = {name: dict(zip(kinds, values, strict=True)) for name, values in last.cell_data.items()}
    for name, values in fields.items():
        of_elements = name in ("stress", "strain_energy")
        for kind in kinds:
            assert np.isnan(values[kind]).all() == ((kind == "line") == of_elements), (name, kind)
    energy = sum(values.sum() for kind, values in fields["strain_energy"].items() if kind != "line")
    assert energy == pytest.approx(state.energy, rel=1e-9)
    before, after = (
        np.linalg.norm(np.diff(points[lines], axis=1)[:, 0], axis=1)
        for points in (last.points, last.points + last.point_data["displacement"])
    )
    assert fields["stretch"]["line"] == pytest.approx(after / before, rel=1e-12)
    if not isinstance(potential, GaussianQuadratic):
        assert np.abs(rest.cell_data["tension_change"][0]).max() < 1e-12 * np.abs(fields["stiffness"]["line"]).max()
        change = fields["stiffness"]["line"] * after - potential.stiffness * before
        assert fields["tension_change"]["line"] == pytest.approx(change, rel=1e-9)


@pytest.mark.parametrize("body", ["cubes", "plane strain", "plane stress", "mixed", "gent"])
def test_stress_of_uniform_strain_is_that_of_finite_elements(body: str) -> None:
    one = solved(body)
    mesh, rule = one.problem.mesh, BODIES[body][2]
    x = mesh.nodes @ (np.eye(mesh.dim) + 0.2 * np.random.default_rng(4).random((mesh.dim,) * 2))
    finite = ts.Fem(rule.get("law", "neo-hookean"), element="linear").potential(one.problem)
    mine = one.path.potential.cell_fields(x)["stress"][-len(mesh.elements) :]  # type: ignore[union-attr]
    expected = finite.cell_fields(x)["stress"]  # type: ignore[attr-defined]
    assert mine == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


def test_study_of_springs_of_second_order_is_reported(tmp_path: Path) -> None:
    """Pictures show the edges: midpoints are no nodes of the mesh."""
    rule, mesh = 'rule = "lloyd"\n', "elements = [8, 2]\n"
    text = changed((rule, 'rule = "gaussian"\nelement = "quadratic"\n'), (mesh, f'{mesh}element = "triangle"\n'))
    study = str(written(tmp_path, text))
    assert main(["check", study, "--out", str(tmp_path), "--quiet"]) == 0
    assert main(["verify", study, "--out", str(tmp_path), "--quiet"]) == 0
    page = (tmp_path / "study" / "report.html").read_text(encoding="utf-8")
    assert "change of tension" in page and (tmp_path / "study" / "check.png").stat().st_size
