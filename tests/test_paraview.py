"""The script that opens results in ParaView, and the form of the files that it opens."""

import ast
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from unittest.mock import MagicMock

import pytest

import truespring as ts
from tests.test_examples import EXAMPLES
from truespring.comparing.options import options_of
from truespring.comparing.sources import find_source, open_source
from truespring.errors import StudyError
from truespring.report.paraview import paraview_script
from truespring.study import read_study, run, write

_NAMES = {"springs": "springs.pvd", 'a "b"': "b.vtkhdf"}


@pytest.mark.parametrize("flat", [True, False])
def test_the_script_warps_every_series_by_its_displacement(
    flat: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Run with a double of paraview.simple, which records the calls."""
    file = tmp_path / "open_in_paraview.py"
    file.write_text(paraview_script(_NAMES, 'a "b"', "displacement", flat), encoding="utf-8")
    double = MagicMock()
    package = ModuleType("paraview")
    package.simple = double  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "paraview", package)
    double.Show.side_effect = lambda *_: MagicMock()
    found: dict[str, object] = {"__file__": str(file)}
    exec(compile(file.read_text(encoding="utf-8"), str(file), "exec"), other := {})
    assert other["FOLDER"] == Path.cwd()
    double.reset_mock()
    exec(compile(file.read_text(encoding="utf-8"), str(file), "exec"), found)
    opened = [call.args[0] for call in double.OpenDataFile.call_args_list]
    assert opened == [str(tmp_path / name) for name in _NAMES.values()]
    assert double.WarpByVector.call_count == 2
    assert double.WarpByVector.return_value.Vectors == ["POINTS", "displacement"]
    displays = found["displays"]
    assert isinstance(displays, dict) and {name: shown.Visibility for name, shown in displays.items()} == {
        "springs": 0,
        'a "b"': 1,
    }
    assert found["view"].InteractionMode == ("2D" if flat else "3D")  # type: ignore[attr-defined]


@pytest.mark.parametrize("form", ["vtu", "vtkhdf"])
def test_a_study_writes_its_levels_in_a_form(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    changes = {"output.form": form, "solver.load_steps": 1, "solver.tolerance": 1e-6, "mesh.elements": [8, 2]}
    study = read_study(EXAMPLES / "bending.toml", **changes)
    result = run(study, refining=False)
    write(result, tmp_path, report=False)
    folder = tmp_path / "bending"
    suffix = {"vtu": ".pvd", "vtkhdf": ".vtkhdf"}[form]
    assert {file.stem for file in folder.glob(f"*{suffix}")} == set(result.solutions)
    assert bool([*folder.glob("*.vtkhdf")]) != bool([*folder.glob("*/*.vtu")])
    tree = ast.parse((folder / "open_in_paraview.py").read_text(encoding="utf-8"))
    values = [ast.literal_eval(one.value) for one in tree.body if isinstance(one, ast.Assign) and _constant(one)]
    assert {name: f"{name}{suffix}" for name in result.solutions} in values and result.model in values
    source = find_source(f"{folder}:linear", options_of(f"{folder}:linear", (), ()))
    again, path = open_source(source, None, None), result.solutions["linear"]
    assert again.load_factors == pytest.approx(path.load_factors)
    assert again.states[-1].displacement == pytest.approx(path.states[-1].displacement, rel=1e-12)


def _constant(one: ast.Assign) -> bool:
    return isinstance(one.targets[0], ast.Name) and one.targets[0].id in ("NAMES", "SHOWN")


def test_a_form_without_its_library_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(StudyError, match=r"output.*\"vtkhdf\" needs h5py: pip install 'truespring\[vtkhdf\]'"):
        read_study(EXAMPLES / "bending.toml", **{"output.form": "vtkhdf"})
    with pytest.raises(StudyError, match=r"(?s)form.*vtk.*vtu"):
        read_study(EXAMPLES / "bending.toml", **{"output.form": "vtk"})


@pytest.mark.verification
@pytest.mark.skipif(shutil.which("pvbatch") is None, reason="ParaView (pvbatch) is not installed")
def test_paraview_shows_the_deformed_body(tmp_path: Path) -> None:
    """Of a bar stretched to 1.5 times its length."""
    problem = ts.Problem(
        ts.box((0.02, 0.01, 0.01), (2, 1, 1)),
        ts.Material(10e3, 0.3),
        supports=[ts.Fixed("left"), ts.Fixed("right", displacement=(0.01, 0.0, 0.0))],
    )
    ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(2)).write(tmp_path / "bar.pvd")
    script = paraview_script({"bar": "bar.pvd"}, "bar", "displacement", flat=False)
    more = '(FOLDER / "x").write_text(str(simple.FindSource("bar, deformed").GetDataInformation().GetBounds()[1]))\n'
    (tmp_path / "open_in_paraview.py").write_text(script + more, encoding="utf-8")
    subprocess.run(["pvbatch", str(tmp_path / "open_in_paraview.py")], capture_output=True, check=True)
    assert float((tmp_path / "x").read_text()) == pytest.approx(0.03)
