"""Broken studies: exit code 2 (or 1 where only solving can tell), one readable message, nothing written."""

from pathlib import Path

import pytest

from tests.studies import changed, written
from truespring.cli import main

STL = '[models.other]\nkind = "stl"\nfile = "other.stl"\n\n[compare]'

RECTANGLE = '[mesh]\nshape = "rectangle"\nsize = ["40 mm", "10 mm"]\nelements = [8, 2]\n'
ON, FORCE = 'on = "right"\n', 'force = ["0 N", "-0.01 N"]\n'
TURNED = '[[support]]\non = "right"\nabout = ["0 mm", "0 mm"]\n\n[solver]'

# What is changed in a good study, and what the message must name: the key, the value or what is allowed.
BROKEN: dict[str, tuple[tuple[str, str], tuple[str, ...]]] = {
    "not TOML": (("[mesh]", "[mesh"), ("TOML", "line 3")),
    "a key twice": (("poisson = 0.3", "poisson = 0.3\npoisson = 0.3"), ("TOML", "line 11")),
    "no mesh": (
        ('[mesh]\nshape = "rectangle"\nsize = ["40 mm", "10 mm"]\nelements = [8, 2]\n', ""),
        ("mesh", "required"),
    ),
    "no models": (
        ('[models.springs]\nkind = "springs"\nrule = "lloyd"\n\n[models.linear]\nkind = "fem"\nlaw = "linear"\n', ""),
        ("models", "required"),
    ),
    "unknown table": (("[solver]", "[solvers]"), ("solvers", "did you mean 'solver'")),
    "unknown key": (("poisson = 0.3", "poison = 0.3"), ("material.poison", "did you mean 'poisson'")),
    "unknown key of a model": (('rule = "lloyd"', 'rul = "lloyd"'), ("models.springs.rul", "did you mean 'rule'")),
    "shape unknown": (('shape = "rectangle"', 'shape = "rectangel"'), ("mesh.shape", "did you mean 'rectangle'")),
    "size a text": (('size = ["40 mm", "10 mm"]', 'size = "40 mm"'), ("mesh.size", "list")),
    "size of three": (('["40 mm", "10 mm"]', '["40 mm", "10 mm", "1 mm"]'), ("mesh.size", "2")),
    "size negative": (('["40 mm", "10 mm"]', '["-40 mm", "10 mm"]'), ("mesh", "-0.04", "positive")),
    "size in kPa": (('["40 mm", "10 mm"]', '["40 kPa", "10 mm"]'), ("mesh.size.1", "40 kPa", "length")),
    "size without unit": (('["40 mm", "10 mm"]', '["40", "10 mm"]'), ("mesh.size.1", "no unit", "160 mm")),
    "elements zero": (("elements = [8, 2]", "elements = [0, 2]"), ("mesh.elements.1", "= 0", "1")),
    "elements fractional": (("elements = [8, 2]", "elements = [8.5, 2]"), ("mesh.elements.1", "8.5", "integer")),
    "mesh too large": (("elements = [8, 2]", "elements = [400000, 100000]"), ("mesh", "GiB", "fewer elements")),
    "elements too flat": (("elements = [8, 2]", "elements = [1, 5000]"), ("mesh", "flatter")),
    "no squares for lloyd": (("elements = [8, 2]", "elements = [8, 3]"), ("models.springs", "squares", "isotropic")),
    "young negative": (('young = "10 kPa"', 'young = "-10 kPa"'), ("material", "-10000", "positive")),
    "young a length": (('young = "10 kPa"', 'young = "10 mm"'), ("material.young", "10 mm", "stress")),
    "young in unknown unit": (('young = "10 kPa"', 'young = "10 kpa"'), ("material.young", "kpa", "case")),
    "young a boolean": (('young = "10 kPa"', "young = true"), ("material.young", "True", "stress")),
    "young infinite": (('young = "10 kPa"', "young = inf"), ("material.young", "inf", "finite")),
    "young empty": (('young = "10 kPa"', 'young = ""'), ("material.young", "stress")),
    "poisson 0.6": (("poisson = 0.3", "poisson = 0.6"), ("material", "0.6", "0.5")),
    "poisson not a number": (("poisson = 0.3", "poisson = nan"), ("material.poisson", "nan", "finite")),
    "poisson a text": (("poisson = 0.3", 'poisson = "0.3"'), ("material.poisson", "0.3", "number")),
    "section unknown": (('"plane-stress"', '"plane stress"'), ("section.kind", "did you mean 'plane-stress'")),
    "thickness zero": (('thickness = "10 mm"', 'thickness = "0 mm"'), ("section", "0.0", "positive")),
    "no thickness": (('thickness = "10 mm"\n', ""), ("section.thickness", "required")),
    "no support": (('[[support]]\non = "left"\n', ""), ("support", "rigid body")),
    "support of nothing": (('on = "left"', 'on = "lef"'), ("support.1.on", "did you mean 'left'")),
    "support between nodes": (('on = "left"', 'on = { x = "1 mm" }'), ("support.1.on", "0.001", "nearest")),
    "empty box": (('on = "left"', "on = { box = [[1, 1], [2, 2]] }"), ("support.1.on", "no node in the box")),
    "box reversed": (('on = "left"', "on = { box = [[1, 1], [0, 0]] }"), ("support.1.on", "lower")),
    "unknown selection": (('on = "left"', 'on = { neer = ["0 mm", "0 mm"] }'), ("support.1.on", "did you mean 'near'")),
    "side of a 3D body": (('on = "left"', 'on = "back"'), ("support.1.on", "3D")),
    "rigid motion": (('on = "left"', 'on = "left"\nfix = ["x"]'), ("support", "along y", "rigid")),
    "body may turn": (('on = "left"', 'on = "left-middle"'), ("support", "turning", "rigid")),
    "unknown direction": (('on = "left"', 'on = "left"\nfix = ["w"]'), ("support.1.fix.1", "'w'", "allowed")),
    "direction of a 3D body": (('on = "left"', 'on = "left"\nfix = ["x", "z"]'), ("support", "'z'", "x, y")),
    "contradicting supports": (
        ("[[load]]", '[[support]]\non = "left-top"\ndisplacement = ["1 mm", "0 mm"]\n\n[[load]]'),
        ("support", "0.001", "one prescribed motion"),
    ),
    "no load": (('[[load]]\non = "right"\nforce = ["0 N", "-0.01 N"]\n', ""), ("load", "nothing loads")),
    "force zero": (('["0 N", "-0.01 N"]', '["0 N", "0 N"]'), ("nothing loads", "load")),
    "force in metres": (('["0 N", "-0.01 N"]', '["0 N", "-0.01 m"]'), ("load.1.force.2", "-0.01 m", "force")),
    "force of one": (('["0 N", "-0.01 N"]', '["-0.01 N"]'), ("load.1.force", "2")),
    "force of three": (('["0 N", "-0.01 N"]', '[0, 0, "-0.01 N"]'), ("load.1.force", "3 values", "2 directions")),
    "displacement of three": (
        ("[[load]]", '[[support]]\non = "right"\ndisplacement = [0, 0, "1 mm"]\n\n[[load]]'),
        ("support.2.displacement", "3 values", "2 directions"),
    ),
    "load steps zero": (("load_steps = 2", "load_steps = 0"), ("solver.load_steps", "0", "1")),
    "control unknown": (("load_steps = 2", 'control = "lod"'), ("solver.control", "did you mean 'load'")),
    "rule unknown": (('rule = "lloyd"', 'rule = "loyd"'), ("models.springs.rule", "did you mean 'lloyd'")),
    "rule and stiffness": (
        ('rule = "lloyd"', 'rule = "lloyd"\nstiffness = { edge = 0.3, diagonal = 0.4 }'),
        ("models.springs", "either a rule"),
    ),
    "neither rule nor stiffness": (('rule = "lloyd"\n', ""), ("models.springs", "either a rule")),
    "no diagonals": (
        ('rule = "lloyd"', "stiffness = { edge = 0.3, diagonal = 0.0 }"),
        ("models.springs", "do not resist"),
    ),
    "negative spring": (
        ('rule = "lloyd"', "stiffness = { edge = -0.3, diagonal = 0.4 }"),
        ("models.springs", "negative", "allow_negative"),
    ),
    "stiffness misspelt": (
        ('rule = "lloyd"', "stiffness = { edge = 0.3, diagonl = 0.4 }"),
        ("models.springs.stiffness.diagonl", "did you mean 'diagonal'"),
    ),
    "sharing unknown": (('rule = "lloyd"', 'rule = "lloyd"\nsharing = "sum"'), ("models.springs.sharing", "'summed'")),
    "area term": (
        ('rule = "lloyd"', 'rule = "lloyd"\nvolume = true'),
        ("models.springs", "isotropic lattices", "gaussian"),
    ),
    "law unknown": (('law = "linear"', 'law = "hooke"'), ("models.linear.law", "hooke", "saint-venant-kirchhoff")),
    "links of the linear law": (
        ('kind = "fem"', 'kind = "heml"'),
        ("models.linear", "law = 'linear'", "mass-tensor"),
    ),
    "neo-Hookean links of squares": (
        ('kind = "fem"\nlaw = "linear"', 'kind = "heml"\nlaw = "neo-hookean"'),
        ("models.linear", "triangle or tetrahedron", "saint-venant-kirchhoff", "kind = 'fem'"),
    ),
    "tensors of squares": (
        ('kind = "fem"\nlaw = "linear"', 'kind = "mass-tensor"\nlaw = "saint-venant-kirchhoff"'),
        ("models.linear", "kind = 'heml'", "law = 'linear'"),
    ),
    "tensors of a logarithm": (
        ('kind = "fem"\nlaw = "linear"', 'kind = "mass-tensor"\nlaw = "neo-hookean"'),
        ("models.linear", "polynomial"),
    ),
    "links without a law": (('kind = "fem"\nlaw = "linear"', 'kind = "heml"'), ("models.linear.law", "missing")),
    "links that are incompressible": (
        ("poisson = 0.3", 'poisson = 0.5\n[models.links]\nkind = "heml"\nlaw = "saint-venant-kirchhoff"'),
        ("material", "0.5", "between -1 and 0.5"),
    ),
    "kind unknown": (('kind = "fem"', 'kind = "fen"'), ("models.linear", "fen", "did you mean 'fem'")),
    "kind missing": (('kind = "fem"\n', ""), ("models.linear", "kind", "springs, fem, heml, ")),
    "decimal comma": (('["0 N", "-0.01 N"]', '["0 N", "-0,01 N"]'), ("load.1.force.2", "-0,01 N", "comma")),
    "blank in a number": (('["0 N", "-0.01 N"]', '["0 N", "1 000 N"]'), ("load.1.force.2", "1 000 N")),
    "arithmetic in a number": (('["0 N", "-0.01 N"]', '["0 N", "9**9**9 N"]'), ("load.1.force.2", "9**9**9 N")),
    "unit alone": (('["0 N", "-0.01 N"]', '["0 N", "N"]'), ("load.1.force.2", "'N'")),
    "number beyond all": (('young = "10 kPa"', f"young = 1{'0' * 400}"), ("material.young", "finite")),
    "stiffer than anything": (('young = "10 kPa"', "young = 1e300"), ("material.young", "1e+300", "range")),
    "elements beyond all": (("elements = [8, 2]", f"elements = [1{'0' * 30}, 1]"), ("mesh.elements.1",)),
    "motion of a free direction": (
        ("[[load]]", '[[support]]\non = "right"\nfix = ["x"]\ndisplacement = ["1 mm", "-8 mm"]\n\n[[load]]'),
        ("support", "along y", "leaves free"),
    ),
    "load on a held side": (('on = "right"', 'on = "left-top"'), ("load", "direction that is free")),
    "model name of an output": (("[models.linear]", "[models.figures]"), ("models", "'figures'")),
    "model names of one letter case": (("[models.linear]", "[models.SPRINGS]"), ("models", "'SPRINGS'")),
    "springs that push where they are pulled": (
        ('rule = "lloyd"', "stiffness = { edge = -0.05, diagonal = 0.5 }\nallow_negative = true"),
        ("models.springs", "do not resist"),
    ),
    "model name with a slash": (("[models.linear]", '[models."a/b"]'), ("models.a/b", "name")),
    "probe unknown": (('"right-middle"', '"right-mid"'), ("compare.probe", "did you mean 'right-middle'")),
    "probe of one number": (('"right-middle"', "[0.04]"), ("compare.probe", "coordinates")),
    "model of compare unknown": (
        ("[compare]", '[compare]\nmodel = "spring"'),
        ("compare.model", "did you mean 'springs'"),
    ),
    "reference unknown": (("[compare]", '[compare]\nreferences = ["liner"]'), ("references", "did you mean 'linear'")),
    "reference is the model": (("[compare]", '[compare]\nreferences = ["springs"]'), ("compare.references", "itself")),
    "tolerance zero": (("[compare]", "[compare]\ntolerance = 0.0"), ("compare.tolerance", "0")),
    "STL missing": (("[compare]", STL), ("models.other", "other.stl")),
    "no material": (('[material]\nyoung = "10 kPa"\npoisson = 0.3\n', ""), ("material", "required and missing")),
    "load without a kind": ((FORCE, ""), ("load.1", "force, traction, pressure")),
    "two loads in one": ((FORCE, f'{FORCE}pressure = "1 Pa"\n'), ("load.1", "force and pressure")),
    "load nowhere": (('on = "right"\nforce', "force"), ("load.1", "on is required")),
    "pressure in newton": ((FORCE, 'pressure = "1 N"\n'), ("load.1.pressure", "stress")),
    "gravity somewhere": ((FORCE, 'gravity = ["0 m/s^2", "-1 m/s^2"]\n'), ("load.1", "whole body", "leave out on")),
    "weight of nothing": ((ON + FORCE, 'gravity = ["0 m/s^2", "-1 m/s^2"]\n'), ("load.1", "density")),
    "gravity downwards": ((ON + FORCE, 'gravity = ["0 m/s^2", "-1 m"]\n'), ("load.1.gravity.2", "acceleration")),
    "moment on a point": ((ON + FORCE, 'on = "right-top"\nmoment = "1 N m"\n'), ("load.1", "two nodes")),
    "centre without a turn": (("[solver]", TURNED), ("support", "about", "rotation")),
    "control misspelt": (("[solver]", '[solver]\ncontrol = "arclength"'), ("solver.control", "arc-length")),
    "nothing controlled": (("[solver]", '[solver]\ncontrol = "displacement"'), ("solver.on", "required and missing")),
    "control of no use": (("[solver]", '[solver]\nto = "1 mm"'), ("solver.to", 'for control = "displacement"')),
    "multigrid past limits": (
        ("[solver]", '[solver]\ncontrol = "arc-length"\nlinear = "multigrid"'),
        ("solver.linear", "factorisations"),
    ),
    "no such image": ((RECTANGLE, '[mesh]\nvoxels = "organ.nii"\nlabel = 1\n'), ("mesh.voxels", "does not exist")),
    "image without a label": ((RECTANGLE, '[mesh]\nvoxels = "organ.nii"\n'), ("mesh.label", "required")),
    "rule a list": (
        ('rule = "lloyd"', 'rule = ["lloyd"]'),
        ("models.springs.rule", "['lloyd']", "did you mean 'lloyd'"),
    ),
    "rule a table": (('rule = "lloyd"', "rule = { lloyd = 1 }"), ("models.springs.rule", "unknown")),
    "element a list": (("elements = [8, 2]", "elements = [8, 2]\nelement = [[]]"), ("mesh", "element", "unknown")),
    "kind a list": (('kind = "fem"', 'kind = ["fem"]'), ("models.linear", "kind = ['fem']", "did you mean 'fem'")),
    "lists in lists": (("elements = [8, 2]", f"elements = {'[' * 5000}{']' * 5000}"), ("nested", "20 deep")),
    "tables in tables": (("elements = [8, 2]", f"{'a.' * 40}a = 1"), ("nested", "20 deep")),
    "a key of thousands of parts": (("elements = [8, 2]", f"{'a.' * 50_000}a = 1"), (":6:", "100 dots")),
    "lists deeper than any key": (("elements = [8, 2]", f"elements = {'[' * 40}{']' * 40}"), ("nested", "20 deep")),
    "integer of thousands of digits": (('young = "10 kPa"', f"young = {'9' * 5000}"), (":9: material.young", "digits")),
    "integer of hundreds of digits": (("load_steps = 2", f"load_steps = {'9' * 900}"), ("solver.load_steps",)),
    "a file's name with a zero byte": ((RECTANGLE, '[mesh]\nfile = "a\\u0000.msh"\n'), ("mesh.file", "non-printing")),
    "a file's name on two lines": ((RECTANGLE, '[mesh]\nfile = "a\\nb.msh"\n'), ("mesh.file", "non-printing")),
    "a file's name that is too long": ((RECTANGLE, f'[mesh]\nfile = "{"a" * 300}.msh"\n'), ("mesh.file", "too long")),
    "a file without a name": ((RECTANGLE, '[mesh]\nfile = ""\n'), ("mesh.file",)),
    "unit of thousands of names": (('young = "10 kPa"', f'young = "5 {"m " * 3000}"'), ("material.young", "100")),
    "number of thousands of digits": (('young = "10 kPa"', f'young = "{"1" * 50000}x!"'), ("material.young", "100")),
    "unit with a zero point": (('young = "10 kPa"', 'young = "5 degC"'), ("material.young", "5 degC")),
    "stiffness beyond all": (
        ('rule = "lloyd"', "stiffness = { edge = 1e300, diagonal = 0.3 }"),
        ("models.springs.stiffness.edge", "1e+300", "range", "1e-30 to 1e+30"),
    ),
    "control of what is held": (
        ("[solver]", '[solver]\ncontrol = "displacement"\non = "left"\ndirection = "x"\nto = "1 mm"'),
        ("solver", "a support holds"),
    ),
    "control along no axis of the body": (
        ("[solver]", '[solver]\ncontrol = "displacement"\non = "right"\ndirection = "z"\nto = "1 mm"'),
        ("solver", "'z'", "x, y"),
    ),
    "network of elements": (
        ("[compare]", '[models.net]\nkind = "network"\n\n[compare]'),
        ("models.net", "nodes and springs"),
    ),
}


def refused(folder: Path, capsys: pytest.CaptureFixture[str], *files: Path) -> str:
    """Run verify on the files, check that they are refused without a trace, and return the message."""
    out = folder / "out"
    assert main(["verify", *map(str, files), "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "Traceback" not in printed.err
    assert not out.exists()
    return printed.err


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_study_is_refused(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change, words = BROKEN[name]
    message = refused(tmp_path, capsys, written(tmp_path, changed(change)))
    assert message.startswith(f"truespring: {tmp_path / 'study.toml'}")
    assert len(message.splitlines()) == 1, message
    for word in words:
        assert word in message, message


def test_there_are_enough_broken_studies() -> None:
    assert len(BROKEN) >= 40


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "empty"),
        (b"this is no STL at all\n" * 20, "STL"),
        (b"solid cut\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "cut"),
        (b"\0" * 80 + (1000).to_bytes(4, "little") + b"\0" * 120, "cut"),
    ],
)
def test_a_broken_stl_is_refused(content: bytes, word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "other.stl").write_bytes(content)
    message = refused(tmp_path, capsys, written(tmp_path, changed(("[compare]", STL))))
    assert "models.other" in message and "other.stl" in message


MOVES = '[dynamics]\nduration = "0.1 s"\n%s\n[solver]'
DENSE = ("poisson = 0.3", "poisson = 0.3\ndensity = 1000")
PART = (
    "[section]",
    '[[region]]\non = { box = [["0 mm", "0 mm"], ["10 mm", "10 mm"]] }\nyoung = 1e4\npoisson = 0.3\n\n[section]',
)
UNEVEN = "over = [[0, 0], [0.5, 1], [0.4, 1]]"
MOVING = {
    "no density": ([("[solver]", MOVES % "")], ("material.density", "a motion needs a density")),
    "no density of a region": ([DENSE, PART, ("[solver]", MOVES % "")], ("region.1.density", "a motion needs")),
    "velocity in space": ([DENSE, ("[solver]", MOVES % "velocity = [1, 0, 0]")], ("dynamics.velocity",)),
    "arc length": (
        [DENSE, ("[solver]", MOVES % "" + '\ncontrol = "arc-length"')],
        ("solver.control", "leave control out"),
    ),
    "iterations of leapfrog": (
        [DENSE, ("[solver]", MOVES % 'scheme = "leapfrog"\nstep = "0.1 ms"\niterations = 2')],
        ("dynamics.iterations", "leave iterations out"),
    ),
    "history of a load": ([('on = "right"', f'on = "right"\n{UNEVEN}')], ("load.1.over", "must ascend")),
    "history of a support": (
        [('on = "left"', f'on = "left"\ndisplacement = ["1 mm", 0]\n{UNEVEN}')],
        ("support.1.over", "must ascend"),
    ),
}


@pytest.mark.parametrize("name", MOVING)
def test_a_wrong_motion_is_an_error_at_its_key(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changes, words = MOVING[name]
    message = refused(tmp_path, capsys, written(tmp_path, changed(*changes)))
    assert len(message.splitlines()) == 1, message
    for word in words:
        assert word in message, message


def test_all_faults_are_told_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = written(tmp_path, changed(("poisson = 0.3", "poison = 0.3")), "first.toml")
    second = written(tmp_path, changed(('on = "left"', 'on = "lef"')), "second.toml")
    good = written(tmp_path, name="good.toml")
    message = refused(tmp_path, capsys, good, first, second, tmp_path / "absent.toml")
    # A key that is not known leaves the one that is meant missing: two faults of one file.
    for word in ("first.toml", "poison", "second.toml", "lef", "absent.toml"):
        assert word in message


def test_two_studies_of_one_stem_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "other").mkdir()
    message = refused(tmp_path, capsys, written(tmp_path), written(tmp_path / "other"))
    assert "'study'" in message and message.count("study.toml") == 2


def test_an_output_that_is_a_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path)
    assert main(["verify", str(file), "--out", str(file)]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_what_only_solving_can_tell_ends_with_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    crushed = changed(('["0 N", "-0.01 N"]', '["-100 N", "0 N"]'), ('law = "linear"', 'law = "saint-venant-kirchhoff"'))
    out = tmp_path / "out"
    assert main(["solve", str(written(tmp_path, crushed)), "--out", str(out)]) == 1
    error = capsys.readouterr().err
    assert "Traceback" not in error
    assert "model 'linear'" in error and "load factor" in error
    assert (out / "study" / "summary.json").exists()
    assert (out / "study" / "curves.csv").exists()


def test_wrong_usage_ends_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["verify"], ["verfy", "x.toml"], ["verify", "x.toml", "--threads", "0"], ["--verbose"]):
        assert main(arguments) == 2
        printed = capsys.readouterr()
        assert printed.out == "" and "usage: truespring" in printed.err
