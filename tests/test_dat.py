"""Results of CalculiX in .dat files: its decks, several sets, energy and force, and what is damaged."""

import re
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.calculix import needs_ccx
from tests.ccx_decks import FORCE, element_deck, run
from truespring.errors import ReferenceFileError
from truespring.exports.calculix import spring_deck
from truespring.reference.dat import read_dat

SETS = "*NODE PRINT, NSET=NALL\nU\n"
ENERGY = "*EL PRINT, ELSET=BODY, TOTALS=ONLY\nELSE\n*NODE PRINT, NSET=HELD, TOTALS=ONLY\nRF\n"


@needs_ccx
def test_energy_is_the_work_of_the_load_and_force_the_reaction(tmp_path: Path) -> None:
    """Of a linear body the energy is half of force times displacement."""
    record = read_dat(run(element_deck("C3D8", last=ENERGY, nlgeom=""), tmp_path).with_suffix(".dat"))
    assert [level.time for level in record.levels] == [1.0, 2.0]
    pulled = int(np.abs(record.levels[0].displacement).sum(axis=1).argmax())
    for scale, level in zip((1.0, 2.0), record.levels, strict=True):
        force = scale * np.array(FORCE)
        assert level.energy == pytest.approx(force @ level.displacement[pulled] / 2, rel=1e-5)
        assert level.force is not None and level.force == pytest.approx(-force, rel=1e-5)
    assert record.notes == ("force is the total force of set HELD: for a set of supports the reaction",)


@needs_ccx
def test_sets_that_are_printed_at_one_time_are_one_level(tmp_path: Path) -> None:
    whole = read_dat(run(element_deck("C3D8"), tmp_path).with_suffix(".dat"))
    both = "*NODE PRINT, NSET=HELD\nU\n*NODE PRINT, NSET=REST\nU\n"
    deck = element_deck("C3D8").replace("*MATERIAL", "*NSET, NSET=REST, GENERATE\n5, 8, 1\n*MATERIAL", 1)
    apart = read_dat(run(deck.replace(SETS, both), tmp_path, "apart").with_suffix(".dat"))
    for level, its in zip(apart.levels, whole.levels, strict=True):
        np.testing.assert_array_equal(level.displacement, its.displacement)
    half = read_dat(
        run(
            element_deck("C3D8").replace(SETS, both.partition("*NODE PRINT, NSET=REST")[0]), tmp_path, "half"
        ).with_suffix(".dat")
    )
    assert np.isnan(half.levels[0].displacement).any(axis=1).sum() == 4
    assert half.notes[0] == "4 of 8 points have no displacement at time 0.5" and "2 more" in half.notes[1]


TWO = (
    "*NODE, NSET=NALL\n1,0,0,0\n2,1,0,0\n3,2,0,0\n*ELEMENT, TYPE=T3D2, ELSET=bar\n1,1,2\n"
    "*ELEMENT, TYPE=SPRINGA, ELSET=Spring\n7,2,3\n*SPRING, ELSET=Spring\n\n3.\n*MATERIAL, NAME=M\n*ELASTIC\n5., 0.\n"
    "*SOLID SECTION, ELSET=bar, MATERIAL=M\n1.\n*BOUNDARY\n1,1,3\n2,2,3\n3,2,3\n*STEP\n*STATIC\n*CLOAD\n3,1,0.1\n"
    "*NODE PRINT, NSET=NALL\nU\n*NODE PRINT, NSET=NALL, TOTALS=ONLY\nRF\n"
    "*EL PRINT, ELSET=bar, TOTALS=ONLY\nELSE\n*EL PRINT, ELSET=Spring, TOTALS=ONLY\nELSE\n*END STEP\n"
)


@needs_ccx
def test_energies_of_sets_that_share_the_body_are_summed(tmp_path: Path) -> None:
    """Two springs in a row: the energy is F^2 / 2 (1/k + 1/k)."""
    record = read_dat(run(TWO, tmp_path).with_suffix(".dat"))
    assert record.levels[0].energy == pytest.approx(0.1**2 / 2 * (1 / 5 + 1 / 3), rel=1e-5)
    assert record.levels[0].force is None and record.notes == ()  # over all nodes it is no load
    assert record.cells["line"].tolist() == [[0, 1], [1, 2]] and record.names == ("1", "2", "3")
    part = TWO.replace("*EL PRINT, ELSET=bar, TOTALS=ONLY\nELSE\n", "")
    record = read_dat(run(part, tmp_path, "part").with_suffix(".dat"))
    assert record.levels[0].energy is None and "SPRING" in record.notes[0]


@needs_ccx
def test_a_deck_of_springs_is_read(tmp_path: Path) -> None:
    problem = ts.Problem(
        mesh=ts.rectangle((0.04, 0.02), (2, 1)),
        material=ts.Material(1e4, 1 / 3),
        section=ts.PlaneStress(0.01),
        supports=ts.Fixed("left"),
        loads=ts.Force("right", (0.0, -0.01)),
    )
    network = ts.Springs("lloyd").potential(problem)
    assert isinstance(network, ts.SpringNetwork)
    record = read_dat(run(spring_deck(problem, network, [0.5, 1.0]), tmp_path).with_suffix(".dat"))
    ours = ts.solve(problem, network).states[-1].displacement
    assert record.levels[-1].displacement[:, :2] == pytest.approx(ours, rel=1e-5, abs=1e-6 * np.abs(ours).max())
    assert record.cells.keys() == {"line"} and record.cells["line"].shape == network.springs.shape
    np.testing.assert_allclose(record.points[:, :2], problem.mesh.nodes, rtol=1e-12)


@needs_ccx
def test_the_deck_is_beside_or_given(tmp_path: Path) -> None:
    stem = run(element_deck("CPS4"), tmp_path)
    other = (tmp_path / "elsewhere").with_suffix(".inp")
    stem.with_suffix(".inp").rename(other)
    with pytest.raises(ReferenceFileError, match=r"body.inp .*--mesh"):
        read_dat(stem.with_suffix(".dat"))
    assert len(read_dat(stem.with_suffix(".dat"), mesh=other).levels) == 3
    with pytest.raises(ReferenceFileError, match=r"are read from its deck, a \.inp file"):
        read_dat(stem.with_suffix(".dat"), mesh=stem.with_suffix(".frd"))
    other.write_text(other.read_text().replace("TYPE=CPS4", "TYPE=DASHPOTA"))
    with pytest.raises(ReferenceFileError, match=r"elsewhere.inp: .*1 DASHPOTA makes none"):
        read_dat(stem.with_suffix(".dat"), mesh=other)
    other.write_text("*NODE\n1,0,0\n2,1,0\n3,1,1\n*ELEMENT,TYPE=CPS3\n1,1,2,3\n")
    with pytest.raises(ReferenceFileError, match=r"set NALL at time 0.5 .* node 4"):
        read_dat(stem.with_suffix(".dat"), mesh=other)


@needs_ccx
def test_what_a_refused_deck_leaves_is_said(tmp_path: Path) -> None:
    stem = run(element_deck("CPS4").replace("100., 0.3", "100., zero"), tmp_path, fails=True)
    with pytest.raises(ReferenceFileError, match=r"body.dat is empty: CalculiX rejected the deck"):
        read_dat(stem.with_suffix(".dat"))


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(element_deck("C3D8", last=ENERGY), tmp_path_factory.mktemp("sample")).with_suffix(".dat")


@needs_ccx
def test_a_file_that_is_cut_is_refused(sample: Path, tmp_path: Path) -> None:
    """But between two tables, where nothing tells."""
    data = sample.read_bytes()
    file, passed = tmp_path / "body.dat", set()
    between = {match.start() for match in re.finditer(rb"(?m)(?<=\n)\n? [dt]", data)} | {len(data)}
    for end in [*range(1, len(data), 7), *between]:
        file.write_bytes(data[:end])
        try:
            read_dat(file, mesh=sample.with_suffix(".inp"))
        except ReferenceFileError as error:
            assert str(file) in str(error) and re.search(r"line \d+|no table", str(error)), error
        else:
            passed.add(end)
    assert {end for end in passed if not any(0 <= place - end <= 1 or place == end - 1 for place in between)} == set()
    assert len(passed) >= 6


DAMAGED = {
    "a letter in a number": (rb"(?m)^(         5.*)\d\.", rb"\1x.", r"line 8: 'x.* is not a number"),
    "a row is shorter": (rb"(?m)^(         5.*)\d$", rb"\1", "line 8: .* is shorter or longer"),
    "a row is missing": (rb"(?m)^         5.*\n", b"", "set NALL at time 0.5 has 8 nodes in the deck, 7 are printed"),
    "a node twice": (rb"(?m)^         5", b"         4", "set NALL at time 0.5: node 4 is repeated"),
    "a node too many": (rb"(?m)^         5", b"        55", "node 55"),
    "no time": (rb"time  0.5", b"time  x.5", "line 2: 'x.*' is not a time"),
    "no energy": (rb"(?m)(energy.*\n\n) .*$", rb"\1 nothing", "line 1[45]: 'nothing' is not a row"),
    "binary": (rb"(?s).*", bytes(range(256)) * 9 + b"\n", "it is binary, not text"),
    "another text": (rb"(?s).*", b"Results\n 1 2 3\n", "no table 'displacements"),
    "another quantity": (rb"displacements", b"velocities", "no table 'displacements"),
    "all lost": (rb"(?m)^( .{9}).{42}$", rb"\1" + b"           NaN" * 3, "level 1 of 3 .time 0.5. has no finite"),
}


@needs_ccx
@pytest.mark.parametrize("name", DAMAGED)
def test_what_is_damaged_is_refused_with_its_place(name: str, sample: Path, tmp_path: Path) -> None:
    old, new, message = DAMAGED[name]
    damaged = re.sub(old, new, sample.read_bytes(), count=0 if name in ("another quantity", "all lost") else 1)
    (tmp_path / "body.dat").write_bytes(damaged)
    assert damaged != sample.read_bytes()
    with pytest.raises(ReferenceFileError, match=message) as error:
        read_dat(tmp_path / "body.dat", mesh=sample.with_suffix(".inp"))
    assert "body.dat" in str(error.value)


@needs_ccx
def test_long_exponents_as_fortran_writes_them(sample: Path, tmp_path: Path) -> None:
    data = sample.read_bytes()
    small = re.sub(rb"(?m)^(         5 .{13})(.{14})", rb"\1  1.234567-123", data, count=1)
    assert small != data
    (tmp_path / "body.dat").write_bytes(small)
    told: list[float] = []
    record = read_dat(tmp_path / "body.dat", told.append, sample.with_suffix(".inp"))
    assert record.levels[0].displacement[4, 1] == pytest.approx(1.234567e-123)
    assert told[-1] == 1.0
