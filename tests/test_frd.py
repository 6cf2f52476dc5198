"""Results of CalculiX in .frd files: held against the .dat of the same run, whatever the format, and damaged."""

import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from tests.calculix import needs_ccx
from tests.ccx_decks import ELEMENTS, element_deck, run
from truespring.errors import ReferenceFileError
from truespring.mesh.cells import CELL_SHAPES
from truespring.reference.dat import read_dat
from truespring.reference.frd import read_frd
from truespring.reference.record import Record
from truespring.reference.scan import CHUNK


def assert_same(record: Record, other: Record) -> None:
    """The digits that .frd files hold are the same: six."""
    assert record.cells.keys() == other.cells.keys() and record.names == other.names
    for name, nodes in other.cells.items():
        np.testing.assert_array_equal(record.cells[name], nodes)
    np.testing.assert_allclose(record.points, other.points, rtol=6e-6)
    assert len(record.levels) == len(other.levels) > 1
    for level, its in zip(record.levels, other.levels, strict=True):
        size = np.abs(its.displacement).max()
        assert size > 1e-4 and level.time == pytest.approx(its.time, rel=1e-5)
        np.testing.assert_allclose(level.displacement, its.displacement, rtol=6e-6, atol=1e-12 * size)


@needs_ccx
@pytest.mark.parametrize("kind", ELEMENTS)
def test_it_says_what_the_dat_says(kind: str, tmp_path: Path) -> None:
    stem = run(element_deck(kind), tmp_path)
    record = read_frd(stem.with_suffix(".frd"))
    assert_same(record, read_dat(stem.with_suffix(".dat")))
    assert [level.time for level in record.levels] == [0.5, 1.0, 2.0] and record.kind == "frd"
    ((name, cells),) = record.cells.items()
    shape = CELL_SHAPES[name]
    assert name == ELEMENTS[kind] and cells.shape == (1, len(shape.places))
    between = [record.points[cells[0, list(few)]].mean(axis=0) for few in shape.between]
    n_corners = len(shape.corners)
    np.testing.assert_allclose(record.points[cells[0, n_corners:]], np.reshape(between, (-1, 3)), rtol=1e-5)


@needs_ccx
def test_a_beam_has_its_middle_last_and_an_expanded_body_its_own_nodes(tmp_path: Path) -> None:
    beam = (
        "*NODE,NSET=NALL\n1,0,0,0\n2,1,0,0\n3,2,0,0\n4,2,1,0\n*ELEMENT,TYPE=T3D3,ELSET=A\n1,1,2,3\n"
        "*ELEMENT,TYPE=T3D2,ELSET=B\n2,3,4\n*ELSET,ELSET=BOTH\nA,B\n*MATERIAL,NAME=M\n*ELASTIC\n100.,0.\n"
        "*SOLID SECTION,ELSET=BOTH,MATERIAL=M\n0.01\n*BOUNDARY\n1,1,3\n2,2,3\n3,2,3\n4,1,3\n*STEP\n*STATIC\n"
        "*CLOAD\n3,1,0.01\n*NODE FILE,OUTPUT=2D\nU\n*NODE PRINT,NSET=NALL\nU\n*END STEP\n"
    )
    record = read_frd(run(beam, tmp_path).with_suffix(".frd"))
    assert record.cells["line3"].tolist() == [[0, 2, 1]] and record.cells["line"].tolist() == [[2, 3]]
    assert read_dat(tmp_path / "body.dat").cells["line3"].tolist() == [[0, 2, 1]]
    expanded = run(element_deck("CPS4", "*NODE FILE, OUTPUT=3D\nU\n"), tmp_path, "expanded")
    assert read_frd(expanded.with_suffix(".frd")).cells["hexahedron"].shape == (1, 8)


@needs_ccx
@pytest.mark.parametrize("kind", ["CPS6", "C3D20"])
def test_binary_and_short_rows_say_the_same(kind: str, tmp_path: Path) -> None:
    text = run(element_deck(kind), tmp_path).with_suffix(".frd")
    binary = run(element_deck(kind, "*NODE OUTPUT\nU\n"), tmp_path, "binary").with_suffix(".frd")
    assert b"\0" in binary.read_bytes()
    assert_same(read_frd(binary), read_frd(text))
    short = tmp_path / "short.frd"
    short.write_text(shortened(text.read_text()))
    assert_same(read_frd(short), read_frd(text))


def of_windows(text: str) -> str:
    """Exponents of three digits, as programs of Windows write them: a number that is negative is one longer."""
    row = re.compile(r"(?m)^( -1.{10})((?:.{12})+)$")
    number = re.compile(r" ?(-?\d\.\d{5}E[+-])(\d\d)")
    return row.sub(lambda one: one[1] + number.sub(r"\g<1>0\2", one[2]) if "E" in one[2] else one[0], text)


@needs_ccx
def test_exponents_of_three_digits_say_the_same(tmp_path: Path) -> None:
    stem = run(element_deck("C3D20"), tmp_path)
    linux = stem.with_suffix(".frd").read_text()
    windows = tmp_path / "windows.frd"
    windows.write_text(of_windows(linux), newline="\r\n")
    assert re.search(r"\dE[+-]0\d\d-\d", windows.read_text()) and re.search(r"\dE[+-]0\d\d\d\.", windows.read_text())
    assert_same(read_frd(windows), read_frd(stem.with_suffix(".frd")))
    assert_same(read_frd(windows), read_dat(stem.with_suffix(".dat")))
    tiny = tmp_path / "tiny.frd"  # -1.00000E-100 is longer than its column everywhere
    tiny.write_text(re.sub(r"(?s)(DISP.*?\n -1 {9}3).{12}", r"\1-1.00000E-100", linux, count=1))
    assert read_frd(tiny).levels[0].displacement[2, 0] == -1e-100
    for damaged, message in {
        of_windows(linux)[: of_windows(linux).index("DISP") + 400]: "truncated",
        re.sub(r"(\d\.\d{5})E([+-]0\d\d-)", r"\1F\2", of_windows(linux)): "not a row .*a node and 3 numbers",
        re.sub(
            r"(\dE[+-]0\d\d)-", r"\1 1.00000E+000-", of_windows(linux)
        ): "not a row of this block: .*a node and 3 numbers",
    }.items():
        windows.write_text(damaged)
        with pytest.raises(ReferenceFileError, match=message):
            read_frd(windows)


COMPOSITE = """*NODE, NSET=NALL
1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,.5,0,0\n6,1,.5,0\n7,.5,1,0\n8,0,.5,0
*ELEMENT, TYPE=S8R, ELSET=E\n1,1,2,3,4,5,6,7,8
*MATERIAL, NAME=M\n*ELASTIC\n1000., .3\n*ORIENTATION,NAME=O\n1.,0.,0.,0.,1.,0.
*SHELL SECTION, ELSET=E, COMPOSITE\n.05,,M,O\n.05,,M,O\n.02,,M,O
*BOUNDARY\n1,1,6\n4,1,6\n8,1,6\n*STEP\n*STATIC\n*CLOAD\n2,3,.01\n3,3,.01\n*NODE FILE\nU\n*END STEP
"""


@needs_ccx
def test_all_layers_of_a_composite_shell_are_read(tmp_path: Path) -> None:
    """One element is announced, three of twenty nodes are there: a layer each, of 1 x 1 and these heights."""
    text = run(COMPOSITE, tmp_path).with_suffix(".frd")
    binary = run(COMPOSITE.replace("NODE FILE", "NODE OUTPUT"), tmp_path, "binary").with_suffix(".frd")
    assert re.search(rb"    3C +1 ", text.read_bytes())
    for file in (text, binary):
        record = read_frd(file)
        cells = record.cells["hexahedron20"]
        assert np.ptp(record.points[cells], axis=1) == pytest.approx(np.array([[1, 1, h] for h in (0.05, 0.05, 0.02)]))
        assert record.notes == ("elements (3C): 1 are stated, 3 were found and read",)
        assert np.abs(record.levels[0].displacement[:, 2]).max() > 0.01
    data = text.read_bytes()
    begin, end = data.index(b"    3C"), data.index(b" -3", data.index(b"    3C"))
    for at in range(begin + 80, end + 3, 7):
        text.write_bytes(data[:at])
        with pytest.raises(ReferenceFileError, match=r"truncated|not a|-3|expected"):
            read_frd(text)


def shortened(text: str) -> str:
    """Numbers of nodes in five columns, fifteen a line, as GraphiX calls the short format."""
    text = re.sub(r"(?m)^(    [23]C.*|  100C.*)1$", r"\g<1>0", text)
    text = re.sub(r"(?m)^ -1 {5}(.{5})", r" -1\1", text)
    text = re.sub(r"(?m)^( -2.*)\n -2(.{100})$", r"\1\2", text)
    text = re.sub(r"(?m)^ -2(.*)$", lambda row: " -2" + "".join(f"{int(n):5d}" for n in row[1].split()), text)
    return re.sub(r"(?m)^ -2(.{75})(.+)$", r" -2\1\n -2\2", text)


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A file with numbers that are glued, of two elements' types of rows."""
    data = run(element_deck("C3D20"), tmp_path_factory.mktemp("sample")).with_suffix(".frd").read_bytes()
    assert re.search(rb"\dE-\d\d-\d", data)
    return data


@needs_ccx
def test_a_file_that_is_cut_is_refused_or_says_so(sample: bytes, tmp_path: Path) -> None:
    file = tmp_path / "cut.frd"
    ends = {match.end() for match in re.finditer(rb"(?m)^ -3\n", sample)}
    passed = set()
    for end in [*range(1, len(sample) - 6, 17), *ends, *(end - 2 for end in ends)]:
        file.write_bytes(sample[:end])
        try:
            record = read_frd(file)
        except ReferenceFileError as error:
            assert str(file) in str(error)
            assert re.search(r"line \d+|no displacement|no nodes", str(error)), error
        else:
            assert any("no end mark 9999" in note for note in record.notes)
            passed.add(end)
    assert {*ends} - {*sorted(ends)[:2]} <= passed <= ends | {end - 1 for end in ends}  # behind a whole block DISP


LOST = "level 3 of 3 .time 2. has no finite displacement"
DAMAGED = {
    "a digit": (rb"(?m)^( -1 +1[ -]\d\.\d)", rb"\1x", "cut|longer|not a row"),
    "a letter in a number": (rb"(?m)^( -1 +5.)\d(?=\.\d{5}E)", rb"\1x", "line 1[78]: 'x.* is not a number"),
    "a node twice": (rb"(?m)^ -1         2(?=.*E.*E)", b" -1         1", "node 1 is repeated"),
    "an unknown node": (rb"(?s)(DISP.*?\n -1)         7", rb"\1        77", "node 77"),
    "an element's node": (rb"(?m)^ -2         1", b" -2        99", "a hexahedron20 .*node 99"),
    "an unknown element": (rb"(?m)^ -1         1    4", b" -1         1   15", r"element type 15 .*: 1, 2"),
    "fewer nodes of an element": (rb"(?m)^ -1         1    4", b" -1         1    2", "has 6"),
    "fewer rows than announced": (rb"(?m)^ -1         4.*\n", b"", "20 rows are stated, after 19 follows '-3'"),
    "more rows than announced": (rb"(?m)^( -1         4.*\n)", rb"\1\1", "-3|repeated"),
    "an unknown format": (rb"(?m)^(    2C.*)1$", rb"\g<1>7", "format 7 "),
    "no number of rows": (rb"(?m)^(    2C +)20", rb"\1xx", "number of rows"),
    "no time": (rb"100CL  101 \d", b"100CL  101 x", "the header of 'DISP' cannot be read"),
    "components": (rb"(?m)^ -5  D3.*\n", b"", "4 rows '-5'"),
    "a strange record": (rb"(?m)^    1PSTEP", b"    7PSTEP", "record of a .frd file"),
    "a second mesh": (rb"(?s)(    2C.*?-3\n)", rb"\1\1", "a second block of nodes"),
    "a zero byte": (rb"(?m)^( -1 +3.*)0$", rb"\1" + b"\0", "is not a row"),
    "coordinates without end": (
        rb"(?m)^( -1         1).*$",
        rb"\1" + b"         inf" * 3,
        "no finite coordinates.* is 1",
    ),
    "a level that is lost": (rb"(?m)^( -1.{10}).{36}$(?=[^C]*9999)", rb"\1" + b"         nan" * 3, LOST),
}


@needs_ccx
@pytest.mark.parametrize("name", DAMAGED)
def test_what_is_damaged_is_refused_with_its_place(name: str, sample: bytes, tmp_path: Path) -> None:
    old, new, message = DAMAGED[name]
    damaged = re.sub(old, new, sample, count=0 if "a level" in name else 1)
    assert damaged != sample
    file = tmp_path / "damaged.frd"
    file.write_bytes(damaged)
    with pytest.raises(ReferenceFileError, match=message) as error:
        read_frd(file)
    assert str(file) in str(error.value)


OTHERS = {
    "empty": (b"", "is empty"),
    "text": (b"Nodes and elements\n1 2 3\n", "line 1: not a .frd file of CalculiX: .* 'Nodes and el"),
    "binary": (bytes(range(256)) * 20, "line 1: not a .frd file"),
    "one line without an end": (b"    1C" + b"x" * 5000, "record of a .frd file"),
    "no mesh": (b"    1C\n 9999\n", "no nodes"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_no_frd_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "other.frd").write_bytes(OTHERS[name][0])
    with pytest.raises(ReferenceFileError, match=OTHERS[name][1]):
        read_frd(tmp_path / "other.frd")


@needs_ccx
def test_a_binary_file_that_is_cut_is_refused_by_its_byte(tmp_path: Path) -> None:
    file = run(element_deck("C3D8", "*NODE OUTPUT\nU\n"), tmp_path).with_suffix(".frd")
    data = file.read_bytes()
    places = [data.index(key) for key in (b"    2C", b"    3C", b" -4  DISP")]
    for place in places:
        file.write_bytes(data[: place + 400 if b"DISP" in data[place : place + 20] else place + 90])
        with pytest.raises(ReferenceFileError, match=r"byte \d+: the file is truncated"):
            read_frd(file)
    file.write_bytes(data.replace(b"\1\0\0\0\1\0\0\0\0\0\0\0\1\0\0\0", b"\1\0\0\0\0\0\0\1\0\0\0\0\1\0\0\0"))
    with pytest.raises(ReferenceFileError, match="element type 16777216 "):
        read_frd(file)


@needs_ccx
def test_modes_and_stopped_runs_are_told(tmp_path: Path) -> None:
    modes = element_deck("C3D8") + "*STEP\n*FREQUENCY\n2\n*NODE FILE\nU\n*END STEP\n"
    record = read_frd(run(modes, tmp_path).with_suffix(".frd"))
    assert len(record.levels) == 3 and record.notes == ("2 mode shapes of a frequency or buckling step were left out",)
    assert len(read_dat(tmp_path / "body.dat").levels) == 3
    stopped = element_deck("C3D8").replace("NLGEOM", "NLGEOM, INC=1")
    record = read_frd(run(stopped, tmp_path, "stopped", fails=True).with_suffix(".frd"))
    assert [level.time for level in record.levels] == [0.5] and "the run was stopped" in record.notes[0]
    record = read_frd(run(element_deck("C3D6", loose=True), tmp_path, "diverged", fails=True).with_suffix(".frd"))
    assert "may not be an equilibrium" in record.notes[0]


@needs_ccx
def test_nodes_without_displacement_are_told(tmp_path: Path) -> None:
    deck = element_deck("C3D8", "*NODE FILE, NSET=HELD\nU\n")
    record = read_frd(run(deck, tmp_path).with_suffix(".frd"))
    assert len(record.points) == 8 and np.isnan(record.levels[0].displacement).any(axis=1).sum() == 4
    assert record.notes[0] == "4 of 8 points have no displacement at time 0.5"


def test_memory_is_that_of_what_is_kept_and_progress_ascends(tmp_path: Path) -> None:
    file = tmp_path / "large.frd"
    write_large(file, side=27, n_levels=2, n_others=5)
    size = file.stat().st_size
    assert 9e6 < size < 15e6
    told: list[float] = []
    read_frd(file)  # what is imported on the way is not counted
    tracemalloc.start()
    try:
        record = read_frd(file, told.append)
        kept, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(record.levels) == 2 and record.levels[1].displacement[5] == pytest.approx([6, -6, 1e-5])
    assert kept < peak < 1.5 * kept + 400 * CHUNK < size / 1.5
    assert len(told) > 10 and told == sorted(told) and 0 < told[0] < 0.1 and told[-1] == 1.0


def write_large(file: Path, side: int, n_levels: int, n_others: int) -> None:
    """A cube of hexahedra with displacements, and stresses that nobody asks for."""
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(1, side**3 + 1).reshape(side, side, side)
    low, high = slice(None, -1), slice(1, None)
    square = ((low, low), (high, low), (high, high), (low, high))
    cells = np.stack([number[(*xy, z)] for z in (low, high) for xy in square], axis=-1).reshape(-1, 8)

    def head(step: int, name: str, components: int) -> str:
        return (
            f"    1PSTEP{step:26d}\n  100CL  101{step:12.5E}{side**3:12d}{0:22d}{step:5d}{1:12d}\n"
            f" -4  {name:8s}{components:5d}    1\n" + " -5  D           1    2    1    0\n" * components
        )

    stress = "".join(f" -1{row:10d}" + "-1.00000E+00" * 6 + "\n" for row in range(1, side**3 + 1))
    moved = "".join(f" -1{row:10d}{row:12.5E}{-row:12.5E} 1.00000E-05\n" for row in range(1, side**3 + 1))
    with file.open("w") as stream:
        stream.write(f"    1C\n    2C{side**3:30d}{1:38d}\n")
        rows = zip(range(1, side**3 + 1), grid.tolist(), strict=True)
        stream.writelines(f" -1{row:10d}{x:12.5E}{y:12.5E}{z:12.5E}\n" for row, (x, y, z) in rows)
        stream.write(f" -3\n    3C{len(cells):30d}{1:38d}\n")
        stream.writelines(
            f" -1{row:10d}    1    0    1\n -2" + "".join(f"{node:10d}" for node in cell) + "\n"
            for row, cell in enumerate(cells.tolist(), 1)
        )
        stream.write(" -3\n")
        for step in range(1, n_levels + 1):
            stream.write(head(step, "DISP", 3) + moved + " -3\n")
        for step in range(1, n_others + 1):
            stream.write(head(step, "STRESS", 6) + stress + " -3\n")
        stream.write(" 9999\n")
