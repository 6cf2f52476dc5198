"""The accessor of PyVista's data sets."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.models import moduli

pv = pytest.importorskip("pyvista")
if not hasattr(pv, "register_dataset_accessor"):
    pytest.skip("PyVista 0.48 or newer is required", allow_module_level=True)

import truespring.accessor  # noqa: E402


def test_an_image_is_a_mesh_of_cubes_with_the_moduli_of_its_springs() -> None:
    image = pv.ImageData(dimensions=(4, 3, 3), spacing=(10.0, 10.0, 10.0))
    mesh = image.truespring.mesh(unit="mm")
    assert mesh.element == "hexahedron" and mesh.measures == pytest.approx(np.full(12, 1e-6))
    found = image.truespring.moduli("isotropic", young=5e3, poisson=0.25, unit="mm")
    assert found.young() == pytest.approx(5e3) and found.poisson() == pytest.approx(0.25)


def test_grids_of_cells_in_the_plane_and_in_space() -> None:
    flat = pv.ImageData(dimensions=(3, 3, 1), spacing=(0.01, 0.02, 1.0)).cast_to_unstructured_grid()
    assert flat.truespring.mesh().element == "quadrilateral"
    assert flat.truespring.mesh().measures.sum() == pytest.approx(8e-4)
    box = ts.box((0.02, 0.01, 0.01), (2, 1, 1), "tetrahedron")
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: box.elements}, box.nodes)
    mesh = grid.truespring.mesh()
    assert (mesh.nodes == box.nodes).all() and (mesh.elements == box.elements).all()
    problem = ts.Problem(
        box, ts.Material(2e3, 0.3), supports=[ts.Fixed("left")], loads=[ts.Force("right", (1.0, 0, 0))]
    )
    ours, theirs = moduli(problem, ts.Springs("gaussian")), grid.truespring.moduli(young=2e3)
    assert theirs.elasticity == pytest.approx(ours.elasticity)
    with pytest.raises(ts.TruespringError, match="there are only 1 line: a body consists of triangles"):
        pv.Line().truespring.mesh()


def test_pyvista_finds_the_accessor_by_its_entry_point() -> None:
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pyvista.accessors"] == {"truespring": "truespring.accessor"}
