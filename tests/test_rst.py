"""Results of Ansys: the file inside its reader, modes of a beam that Ansys solved, and what is damaged."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from truespring.errors import ReferenceFileError
from truespring.mesh.cells import CELL_SHAPES
from truespring.reference import rst
from truespring.reference.record import Record
from truespring.reference.rst import read_rst
from truespring.reference.vtk_cells import sized

pytest.importorskip("ansys.mapdl.reader")


@pytest.fixture(scope="module")
def sample() -> Path:
    from ansys.mapdl.reader import examples

    return Path(examples.rstfile)


@pytest.fixture(scope="module")
def record(sample: Path) -> Record:
    return read_rst(sample)


def test_all_sets_are_read_at_their_nodes(sample: Path) -> None:
    from ansys.mapdl import reader

    told: list[float] = []
    record = read_rst(sample, told.append)
    result = reader.read_binary(sample)
    assert record.kind == "rst" and told == sorted(told) and told[-1] == 1.0
    assert [level.time for level in record.levels] == result.time_values.tolist() and len(record.levels) == 6
    assert record.points.shape == (321, 3) and record.names == tuple(map(str, range(1, 322)))
    np.testing.assert_array_equal(record.points, result.mesh.nodes)
    for number, level in enumerate(record.levels):
        nodes, values = result.nodal_solution(number)
        np.testing.assert_array_equal(level.displacement[nodes - 1], values)
    (note,) = record.notes
    assert "all levels are mode shapes" in note


def test_its_cells_are_those_of_vtk(record: Record) -> None:
    """A beam of 2 x 2 x 10 bricks, 1 x 1 x 5: their middles lie midway, their volumes are 1/8."""
    ((name, cells),) = record.cells.items()
    assert name == "hexahedron20" and cells.shape == (40, 20)
    shape = CELL_SHAPES[name]
    for place, few in enumerate(shape.between, 8):
        middle = record.points[cells[:, list(few)]].mean(axis=1)
        np.testing.assert_allclose(record.points[cells[:, place]], middle, atol=1e-12)
    size = np.ptp(record.points[cells], axis=1)
    np.testing.assert_allclose(size.prod(axis=1), 1 / 8, rtol=1e-12)


def test_cells_that_lack_a_middle_become_their_corners() -> None:
    """Ansys may leave middles out; its reader makes points of no number there."""
    types, offsets = np.array([10, 10, 1, 3]), np.array([0, 10, 20, 21, 23])
    connectivity = np.array([*range(10), *range(1, 11), 0, 4, 5])
    is_made = np.arange(11) == 10
    cells, n_lost = sized(types, offsets, connectivity, is_made, Path("file.rst"))
    assert n_lost == 1 and {name: nodes.tolist() for name, nodes in cells.items()} == {
        "tetra10": [list(range(10))],
        "tetra": [[1, 2, 3, 4]],
        "line": [[4, 5]],
    }
    with pytest.raises(ReferenceFileError, match=r"file.rst: a tetra of 9 nodes is not supported"):
        sized(types[:1], np.array([0, 9]), connectivity, is_made, Path("file.rst"))


@pytest.mark.verification
def test_a_file_of_ansys_before_14_is_read(sample: Path, record: Record, tmp_path: Path) -> None:
    """Its header has 40 words, not 80; behind it the record that follows begins with its own length, flag and numbers.

    So it is in files of 13.0, which Ansys' reader takes: words beyond the 40 are none.
    """
    data = bytearray(sample.read_bytes())
    words = np.frombuffer(data, "<i4")
    assert words[103] == 80
    old = words.copy()
    old[103] = 40
    old[145:155] = [40, 3, -(2**31), 1, 2, 3, 3, 216, -(2**31), 128]
    old[11] = int.from_bytes(b"0.31", "little")
    (tmp_path / "old.rst").write_bytes(old.tobytes())
    found = read_rst(tmp_path / "old.rst")
    np.testing.assert_array_equal(found.points, record.points)
    assert [level.time for level in found.levels] == [level.time for level in record.levels]
    for level, its in zip(found.levels, record.levels, strict=True):
        np.testing.assert_array_equal(level.displacement, its.displacement)


def test_elements_that_are_no_cells_are_left_out() -> None:
    """Of contact and the like: Ansys' reader gives them VTK's type 0."""
    cells, n_lost = sized(
        np.array([10, 0, 0]),
        np.array([0, 4, 5, 8]),
        np.array([*range(4), 0, 1, 2, 3]),
        np.zeros(4, bool),
        Path("a.rst"),
    )
    assert n_lost == 0 and {name: nodes.tolist() for name, nodes in cells.items()} == {"tetra": [[0, 1, 2, 3]]}


def test_a_file_that_is_cut_is_refused(sample: Path, tmp_path: Path) -> None:
    data = sample.read_bytes()
    file = tmp_path / "cut.rst"
    messages = {0: "is empty", 3: "is no .rst file", 100: "truncated in its header", 700: "truncated in its header"}
    messages |= dict.fromkeys((1000, 50_000, 300_000, 907_900), "907,920 bytes.* has [0-9,]+: ")
    for end, message in messages.items():
        file.write_bytes(data[:end])
        with pytest.raises(ReferenceFileError, match=f"cut.rst.*{message}"):
            read_rst(file)


@pytest.mark.parametrize(
    ("place", "damage", "message"),
    [
        (0, b"Nodes and elements", "is no .rst file of Ansys"),
        (420, b"\xff" * 40, "damaged in its header"),
        (452, b"\0" * 4, "has no result set"),
        (480, b"\xff" * 4, "damaged in its header"),  # a pointer
        (300_000, b"\xff" * 40, "is damaged or not supported"),  # its reader ends the process
        (282_400, b"\xff" * 40, "is damaged or not supported"),  # its reader raises
    ],
    ids=["text", "header", "no sets", "pointer", "aborts", "raises"],
)
def test_what_is_damaged_is_refused(place: int, damage: bytes, message: str, sample: Path, tmp_path: Path) -> None:
    data = bytearray(sample.read_bytes())
    data[place : place + len(damage)] = damage
    (tmp_path / "damaged.rst").write_bytes(data)
    with pytest.raises(ReferenceFileError, match=f"damaged.rst.*{message}"):
        read_rst(tmp_path / "damaged.rst")


def test_a_reader_that_never_returns_is_ended(sample: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rst, "_CHILD", "import time; time.sleep(60)")
    monkeypatch.setattr(rst, "_PATIENCE", 0.2)
    with pytest.raises(ReferenceFileError, match="nothing was read for 1 s"):
        read_rst(sample)
    monkeypatch.setattr(rst, "_CHILD", "import time; filled = bytearray(300 << 20); time.sleep(60)")
    monkeypatch.setattr(rst, "_PATIENCE", 60.0)
    monkeypatch.setattr(rst, "_MEMORY", 150 << 20)
    with pytest.raises(ReferenceFileError, match=r"reading it needed \d+ MiB"):
        read_rst(sample)


def test_the_library_is_named_where_it_is_missing(sample: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ReferenceFileError, match=r"pip install 'truespring\[ansys\]'"):
        read_rst(sample)
