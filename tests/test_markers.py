"""Tables of markers, pairs of STL files, and what any result file is refused for."""

from pathlib import Path

import numpy as np
import pytest

from truespring.errors import ReferenceFileError
from truespring.reference.markers import read_markers
from truespring.reference.result import READERS, read_record

MARKERS = "marker,x [mm],y [mm],ux [mm],uy\na,10,0,1,0.002\nb,20,5,-1,0\n"
LEVELS = (
    "marker,load_factor,x,y,z,ux,uy,uz\na,0.5,0,0,1,1,2,3\nb,0.5,1,0,1,4,5,6\nb,1,1,0,1,40,50,60\na,1,0,0,1,7,8,9\n"
)


def written(folder: Path, text: str, name: str = "markers.csv") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_columns_carry_their_own_units(tmp_path: Path) -> None:
    told: list[float] = []
    record = read_record(written(tmp_path, MARKERS), reading=told.append)
    assert record.kind == "csv" and record.names == ("a", "b") and record.cells == {} and told == [1.0]
    assert record.points == pytest.approx(np.array([[0.01, 0, 0], [0.02, 0.005, 0]]))
    (level,) = record.levels
    assert level.time == 1.0 and level.displacement == pytest.approx(np.array([[1e-3, 2e-3, 0], [-1e-3, 0, 0]]))


def test_levels_are_grouped_by_load_factor_and_matched_by_name(tmp_path: Path) -> None:
    record = read_markers(written(tmp_path, LEVELS))
    assert [level.time for level in record.levels] == [0.5, 1.0]
    assert record.levels[1].displacement.tolist() == [[7, 8, 9], [40, 50, 60]]
    assert record.points.tolist() == [[0, 0, 1], [1, 0, 1]]


def test_positions_at_rest_may_stand_in_a_file_of_their_own(tmp_path: Path) -> None:
    rest = written(tmp_path, "marker,x [cm],y\na,1,0\nb,2,1\n", "rest.csv")
    moved = written(tmp_path, "marker,x,y,load_factor\nb,0.03,1,1\na,0.01,0.5,1\n")
    record = read_record(moved, undeformed=rest)
    assert record.names == ("a", "b") and record.levels[0].displacement == pytest.approx(
        np.array([[0, 0.5, 0], [0.01, 0, 0]])
    )
    by_row = read_markers(
        written(tmp_path, "x,y\n3,0\n1,1\n"), undeformed=written(tmp_path, "x,y\n1,0\n0,0\n", "rest.csv")
    )
    assert by_row.levels[0].displacement.tolist() == [[2, 0, 0], [1, 1, 0]] and by_row.names == ()


def test_a_lost_marker_is_told(tmp_path: Path) -> None:
    record = read_markers(written(tmp_path, MARKERS.replace("-1,0\n", "nan,nan\n")))
    assert "1 of 2 points have no displacement at time 1" in record.notes
    assert "columns without a unit are in metres: uy" in record.notes


ROWS = (("tip", 160.0, 20.0, -31.4, -85.2), ("base", 0.0, 20.0, 0.25, 0.0))
PLAIN = ("marker", "x [mm]", "y [mm]", "ux [mm]", "uy [mm]")


def table(heads: tuple[str, ...], separator: str = ",", decimal: str = ".") -> str:
    """A table of the markers, without their names where there is one head less."""
    rows = [[str(value).replace(".", decimal) for value in row[len(row) - len(heads) :]] for row in ROWS]
    return "\n".join(separator.join(line) for line in (heads, *rows)) + "\n"


SPELLINGS = {
    "plain": table(PLAIN),
    "tabs": table(PLAIN, "\t"),
    "tabs and decimal commas": table(PLAIN, "\t", ","),
    "semicolons and decimal commas": table(PLAIN, ";", ","),
    "semicolons and points": table(PLAIN, ";"),
    "told separator": "sep=;\n" + table(PLAIN, ";", ","),
    "round brackets": table(("marker", "x (mm)", "y (mm)", "ux (mm)", "uy (mm)")),
    "glued": table(("marker", "x_mm", "y_mm", "ux_mm", "uy_mm")),
    "glued twice": table(("marker", "x_mm [mm]", "y_mm", "u_x_mm", "u_y [mm]")),
    "capitals": table(("Marker", "X [mm]", "Y [mm]", "UX [mm]", "UY [mm]")),
    "VIC-3D": table(('"marker"', '"X [mm]"', ' "Y [mm]"', '"U [mm]"', '"V [mm]"')),
    "ParaView": table(('"Points:0 (mm)"', '"Points:1 (mm)"', '"displacement:0 (mm)"', '"displacement:1 (mm)"')),
    "Abaqus": table(("ID", "COORD1 [mm]", "COORD2 [mm]", "U1 [mm]", "U2 [mm]")),
    "DICe": table(("COORDINATE_X [mm]", "COORDINATE_Y [mm]", "DISPLACEMENT_X [mm]", "DISPLACEMENT_Y [mm]")),
    "byte order mark": "\ufeff" + table(PLAIN),
    "Fortran's exponents": table(PLAIN).replace("160.0", "1.6D+02").replace("0.25", "0.025d1"),
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_tables_as_other_programs_write_them(name: str, tmp_path: Path) -> None:
    record = read_record(written(tmp_path, SPELLINGS[name]))
    assert record.points == pytest.approx(1e-3 * np.array([[160, 20, 0], [0, 20, 0]]))
    assert record.levels[0].displacement == pytest.approx(1e-3 * np.array([[-31.4, -85.2, 0], [0.25, 0, 0]]))
    assert record.names in ((), ("tip", "base")) and not record.notes


def test_spreadsheets_write_two_bytes_a_letter(tmp_path: Path) -> None:
    (tmp_path / "markers.csv").write_bytes(SPELLINGS["tabs and decimal commas"].encode("utf-16"))
    assert read_record(tmp_path / "markers.csv").points[0] == pytest.approx([0.16, 0.02, 0])


def test_columns_that_tell_something_else_are_left_out_and_told(tmp_path: Path) -> None:
    text = "X [mm],Y [mm],Z [mm],U [mm],V [mm],W [mm],exx,sigma [pixel],x [pixel],u [pixel]\n1,2,3,4,5,6,7,8,9,10\n"
    record = read_record(written(tmp_path, text))
    assert record.points.tolist() == [[0.001, 0.002, 0.003]]
    assert record.levels[0].displacement == pytest.approx(np.array([[0.004, 0.005, 0.006]]))
    assert record.notes == ("ignored columns: sigma [pixel], x [pixel], u [pixel], exx",)


WRONG = {
    "no displacement": ("x,y\n0,0\n", None, r"there is no displacement: add columns ux, uy, or add a second file"),
    "both": (MARKERS, "x,y\n0,0\n", "has the displacement in column ux: leave undeformed out"),
    "unknown column": ("x,y,u\n0,0,0\n", None, "markers.csv:1: column 'u' is unknown"),
    "missing column": ("x,ux\n0,0\n", None, "markers.csv:1: column y is missing"),
    "half a displacement": ("x,y,ux\n0,0,0\n", None, "markers.csv:1: positions have x, y, displacements ux$"),
    "no number": (MARKERS.replace("20", "far"), None, "markers.csv:3: x = 'far' .*number"),
    "no number behind a blank line": (
        MARKERS.replace("\nb,20", "\n\nb,far"),
        None,
        "markers.csv:4: x = 'far' .*number",
    ),
    "truncated": (MARKERS[:-5], None, "markers.csv:3: 4 values.* 5 columns"),
    "twice": (MARKERS.replace("b,", "a,"), None, "markers.csv:3: marker 'a' is defined twice, first in line 2"),
    "all lost": (MARKERS.replace(",1,0.002", ",nan,0").replace("-1,0", "0,nan"), None, "no finite displacement"),
    "place lost": (MARKERS.replace("10", "nan"), None, "have no finite coordinates.*the first is a"),
    "only names": ("marker,x,y,ux,uy\n", None, "at least one row"),
    "empty": ("", None, "is empty"),
    "binary": ("\0\1\2\n\3\4", None, "not a CSV file|unknown"),
    "unit of another kind": (MARKERS.replace("[mm]", "[N]", 1), None, "markers.csv:1: x: "),
    "another marker": (LEVELS.replace("b,1,1", "c,1,1"), None, "marker 'c' is there only at load_factor 1"),
    "a marker less": (LEVELS.replace("b,1,1,0,1,40,50,60\n", ""), None, "marker 'b' is missing at load_factor 1"),
    "rests elsewhere": (LEVELS.replace("b,1,1,0", "b,1,2,0"), None, "markers.csv:4: the undeformed position"),
    "names in one file": ("marker,x,y\na,0,0\n", "x,y\n0,0\n", "only one of both files has a column marker"),
    "more rows": ("x,y\n0,0\n1,1\n", "x,y\n0,0\n", "2 markers are here, 1 are undeformed"),
    "two units in one column": (MARKERS.replace("x [mm]", "x_mm [m]"), None, "has two units, mm and m: keep one"),
    "units of places alone": (
        "x [mm],y [mm],ux,uy\n1,2,3,4\n",
        None,
        r"column x is in mm, ux has no unit.* Write ux \[m\], or ux \[mm\]",
    ),
    "two decimal signs": (table(PLAIN, ";", ",").replace("0,25", "0.25"), None, "has a comma, '0.25' a point"),
    "one column twice": (MARKERS.replace("marker,", "X,"), None, "column x .*twice.* 'x .mm.'"),
    "nearly a column": (MARKERS.replace("marker", "load_factr"), None, r"did you mean 'load_factor'.*may be: marker,x"),
    "in space and plane": ("x,y,z\n0,0,0\n", "x,y\n0,0\n", "positions have x, y, z, those in .*rest.csv x, y"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_damaged_is_refused_with_its_place(name: str, tmp_path: Path) -> None:
    text, rest, message = WRONG[name]
    undeformed = None if rest is None else written(tmp_path, rest, "rest.csv")
    with pytest.raises(ReferenceFileError, match=message) as error:
        read_record(written(tmp_path, text), undeformed=undeformed)
    assert "markers.csv" in str(error.value)


# --- pairs of STL files -------------------------------------------------------------------------------------------


def test_two_stl_files_tell_where_each_point_went(tmp_path: Path) -> None:
    from trimesh.creation import box

    body = box((1.0, 2.0, 3.0))
    rest, file = tmp_path / "rest.stl", tmp_path / "deformed.stl"
    body.export(rest)
    corners = np.array(body.vertices)
    body.vertices = corners + 0.1 * corners[:, ::-1]
    body.export(file)
    told: list[float] = []
    record = read_record(file, undeformed=rest, reading=told.append)
    assert record.kind == "stl" and record.cells["triangle"].shape == (12, 3) and record.points.shape == (8, 3)
    np.testing.assert_allclose(record.levels[0].displacement, 0.1 * record.points[:, ::-1], atol=1e-6)
    assert told == [0.5, 1.0]
    with pytest.raises(ReferenceFileError, match=r"deformed\.stl: .*undeformed"):
        read_record(file)
    data = file.read_bytes()
    file.write_bytes(data[:84] + data[134:] + data[84:134])
    with pytest.raises(ReferenceFileError, match="moves to two positions"):
        read_record(file, undeformed=rest)
    file.write_bytes(data[:300])
    with pytest.raises(ReferenceFileError, match="truncated"):
        read_record(file, undeformed=rest)
    file.write_bytes(data[:80] + (11).to_bytes(4, "little") + data[84:-50])
    with pytest.raises(ReferenceFileError, match="has 11 facets"):
        read_record(file, undeformed=rest)


# --- any result ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", READERS)
def test_files_that_are_no_result_are_refused(suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"result{suffix}"
    with pytest.raises(ReferenceFileError, match=f"result{suffix} does not exist: check the path"):
        read_record(file)
    file.write_bytes(b"")
    with pytest.raises(ReferenceFileError, match=f"result{suffix} is empty"):
        read_record(file)
    for data in (bytes(range(256)) * 40, b"nothing of the kind\n" * 50):
        file.write_bytes(data)
        undeformed = file if suffix == ".stl" else None
        if suffix == ".dat":
            (tmp_path / "result.inp").write_text("*NODE\n1,0,0\n2,1,0\n3,1,1\n*ELEMENT,TYPE=CPS3\n1,1,2,3\n")
        with pytest.raises(ReferenceFileError, match=f"result{suffix}"):
            read_record(file, undeformed=undeformed)
    file.unlink()
    file.mkdir()
    with pytest.raises(ReferenceFileError, match=f"result{suffix} is a folder"):
        read_record(file)


def test_what_ends_otherwise_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReferenceFileError, match=r"is \.frd, \.dat, .*, not '\.frdx' \(did you mean '\.frd'\?\)"):
        read_record(tmp_path / "body.frdx")
    with pytest.raises(ReferenceFileError, match=r"mesh does not apply to \.frd files, only to \.dat"):
        read_record(tmp_path / "body.frd", mesh=tmp_path / "body.inp")
    with pytest.raises(ReferenceFileError, match="is a folder"):
        read_record(tmp_path)
