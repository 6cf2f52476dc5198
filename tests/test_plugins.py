"""Entry points: the example package in examples/plugin, made known to Python by a dist-info folder as pip writes it."""

import json
import os
import re
import subprocess
import sys
import tomllib
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.studies import written
from truespring.cli import main
from truespring.errors import PluginError
from truespring.exports import TARGETS
from truespring.mesh.files import FORMATS
from truespring.models import LAWS, RULES, moduli
from truespring.plugins import PluginWarning, Table
from truespring.reference import READERS

PLUGIN = Path(__file__).parents[1] / "examples" / "plugin"
TABLES: dict[str, Table] = {table.group: table for table in (RULES, LAWS, READERS, FORMATS, TARGETS)}


def install(folder: Path, name: str, points: dict[str, dict[str, str]]) -> None:
    """Write what pip writes of a package: its name and entry points."""
    info = folder / f"{name}-0.1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1.0\n", encoding="utf-8")
    lines = []
    for group, own in points.items():
        lines += [f"[{group}]", *(f"{key} = {value}" for key, value in own.items())]
    (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of installed packages; tables look for entry points anew, and forget what they found afterwards."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    forget()
    yield folder
    forget()
    for name in [name for name in sys.modules if name.split(".")[0] == "springlab"]:
        del sys.modules[name]


def forget() -> None:
    for table in TABLES.values():
        table.__dict__.pop("_found", None)
        table._loaded.clear()
        table._failed.clear()


@pytest.fixture
def springlab(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(PLUGIN / "src"))
    project = tomllib.loads((PLUGIN / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    install(site, project["name"], project["entry-points"])


def test_the_example_package_is_in_every_table(springlab: None) -> None:
    project = tomllib.loads((PLUGIN / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"].keys() == TABLES.keys()
    for group, table in TABLES.items():
        (name,) = project["entry-points"][group]
        assert name in table and name in list(table) and isinstance(table[name], table.kind)
        assert len(table) == len(table.own) + 1 and list(table)[: len(table.own)] == list(table.own)


def test_a_rule_of_a_package_makes_springs_with_the_moduli_that_it_states(springlab: None) -> None:
    problem = ts.Problem(
        ts.rectangle((0.04, 0.04), (4, 4)),
        ts.Material(9e3, 1 / 3),
        ts.PlaneStress(0.01),
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(0.1, 0.0))],
    )
    found = moduli(problem, ts.Springs("uniform"))
    assert found.young() == pytest.approx(4 / 3 * 9e3) and found.poisson() == pytest.approx(1 / 3)
    assert ts.solve(problem, ts.Springs("uniform")).status is ts.Status.CONVERGED


@pytest.mark.parametrize("model", [ts.Fem("neo-hookean"), "gaussian"])
def test_a_law_of_a_package_is_one_of_elements_and_of_gaussian_springs(springlab: None, model: object) -> None:
    """Near rest and near J = 1 it is neo-Hookean."""
    problem = ts.Problem(
        ts.box((0.04, 0.02, 0.02), (2, 1, 1)),
        ts.Material(9e3, 0.3),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, 1e-4, 0.0))],
    )
    known, new = (
        (ts.Springs("gaussian"), ts.Springs("gaussian", law="ciarlet"))
        if model == "gaussian"
        else (ts.Fem("neo-hookean"), ts.Fem("ciarlet"))
    )
    ours, theirs = (ts.solve(problem, one).states[-1].displacement for one in (known, new))
    assert np.abs(theirs - ours).max() < 1e-3 * np.abs(ours).max()
    assert (theirs != ours).any()


def test_files_of_formats_of_a_package_are_read(springlab: None, tmp_path: Path) -> None:
    off = tmp_path / "square.off"
    off.write_text("OFF\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0.5 0\n4 0 1 2 3\n3 1 4 2\n3 4 1 0 # flat\n")
    with pytest.raises(ts.TruespringError):
        ts.read_mesh(off)
    off.write_text("OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0.5 0\n4 0 1 2 3\n3 1 4 2\n")
    mesh = ts.read_mesh(off, unit="mm")
    assert mesh.n_nodes == 5 and mesh.measures.sum() == pytest.approx(1.5e-6)
    off.write_text("OFF\n5 2 0\n0 0 0\n")
    with pytest.raises(ts.TruespringError, match=r"square\.off: .*truncated"):
        ts.read_mesh(off)
    assert READERS[".npy"].recognises(b"\x93NUMPY\x01\x00")
    np.save(tmp_path / "moved.npy", np.arange(12.0).reshape(2, 6))
    record = READERS[".npy"].read(tmp_path / "moved.npy")
    assert record.levels[-1].displacement.tolist() == [[3.0, 4.0, 5.0], [9.0, 10.0, 11.0]]


def test_the_verb_export_writes_a_target_of_a_package(
    springlab: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(written(tmp_path)), "--to", "csv", "--out", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["target"] == "csv"
    head, *rows = (tmp_path / "study" / "springs.csv").read_text(encoding="utf-8").splitlines()
    assert head.startswith("a,b,") and len(rows) > 5
    assert json.loads((tmp_path / "study" / "exported.json").read_text())["left_out"].startswith("Nodes")
    assert main(["export", str(written(tmp_path)), "--to", "csx", "--out", str(tmp_path)]) == 2
    assert "did you mean 'csv'" in capsys.readouterr().err


def test_an_entry_that_cannot_be_used_names_its_package_and_stops_nothing_else(site: Path) -> None:
    install(
        site,
        "broken",
        {
            "truespring.rules": {
                "gone": "no_such_module:RULE",
                "text": "json:dumps",
                "lloyd": "json:loads",
                "twice": "json:dumps",
            }
        },
    )
    install(site, "other", {"truespring.rules": {"twice": "json:dumps"}})
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # what the library has asks no package
        assert RULES["lloyd"] is RULES.own["lloyd"]
    with pytest.warns(PluginWarning, match=r"package broken 0\.1\.0.*'lloyd' is left out.*rename"):
        assert "gone" in RULES
    for name, words in (
        ("gone", r"package broken 0\.1\.0.*'gone' = no_such_module:RULE cannot be loaded: ModuleNotFound.*uninstall"),
        ("text", r"'text' = json:dumps is a function, must be a Rule"),
        ("twice", r"'twice' is in package broken 0\.1\.0 and package other 0\.1\.0: uninstall one"),
    ):
        with pytest.raises(PluginError, match=words):
            ts.Springs(name)
            RULES[name]
    with pytest.warns(PluginWarning) as caught:
        assert list(RULES) == list(RULES.own)
    assert len(caught) == 3 and str(caught[0].message).startswith("left out: package broken")
    assert list(RULES) == list(RULES.own)  # each is warned of once


def test_the_help_searches_no_packages() -> None:
    """It would take longer than the rest."""
    asked = """
import sys
from truespring.cli import main
for verb in ("export", "map", "compare"):
    assert main([verb, "--help"]) == 0
print("searched:", "truespring.plugins" in sys.modules)
"""
    shown = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True).stdout
    assert shown.splitlines()[-1] == "searched: False"


@pytest.mark.verification
def test_pip_installs_the_example_package(tmp_path: Path) -> None:
    pytest.importorskip("hatchling", reason="pip needs the build system of the package, here without a network")
    target = tmp_path / "target"
    install_it = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-build-isolation", "--no-index", "--quiet"]
    subprocess.run([*install_it, "--target", str(target), str(PLUGIN)], check=True, capture_output=True, text=True)
    asked = (
        "import sys; sys.path.insert(0, sys.argv[1]); from truespring.models import RULES; print(RULES['uniform'].idea)"
    )
    shown = subprocess.run([sys.executable, "-c", asked, str(target)], capture_output=True, text=True, check=True)
    assert "one stiffness" in shown.stdout


@pytest.mark.verification
def test_the_entries_of_an_installed_package_keep_the_contracts(tmp_path: Path) -> None:
    """Installed by pip, without a network; the tests of rules, laws, targets and formats run over its entries."""
    pytest.importorskip("hatchling")
    root, site = PLUGIN.parents[1], tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--target", str(site)]
    subprocess.run([*pip, str(PLUGIN)], check=True)
    entries = {name: f"tests/test_{name}.py" for name in ("rules", "laws", "export")}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *entries.values()]
    chosen = "(uniform or ciarlet or csv)"
    path = os.pathsep.join([str(site), str(root / "src"), str(root)])
    done = subprocess.run(
        [*command, "-k", chosen, "-m", "not verification"],
        cwd=root,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    (passed,) = re.findall(r"(\d+) passed", done.stdout)
    assert int(passed) >= 15
