"""Former names work for one release: each warns, and does what the present name does."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import truespring as ts
from tests.studies import written
from truespring.calibration import LoadCase
from truespring.sweeping import Sweep

EXAMPLES = Path(ts.__file__).parent / "examples"
PROBLEM = ts.Problem(
    mesh=ts.rectangle((0.04, 0.01), (4, 1)),
    material=ts.Material(10e3, 0.3),
    section=ts.PlaneStress(0.01),
    supports=[ts.Fixed("left")],
    loads=[ts.Force("right", (0.0, -0.001))],
)
NEWTON = ts.Newton(load_steps=1)


def progress_of(run: Callable[..., Any], name: str) -> list[tuple[object, ...]]:
    """What a function passes to the callback of this name."""
    calls: list[tuple[object, ...]] = []
    run(**{name: lambda *given: calls.append(given)})
    assert calls
    return calls


def solving(_: Path, name: str) -> list[tuple[object, ...]]:
    return progress_of(partial(ts.solve, PROBLEM, ts.Fem("neo-hookean"), NEWTON), name)


def calibrating(_: Path, name: str) -> list[tuple[object, ...]]:
    case = LoadCase("case", PROBLEM, ts.solve(PROBLEM, ts.Fem("linear"), NEWTON), solver=NEWTON)
    return progress_of(partial(ts.calibrate, case, ts.Springs("lloyd"), evaluations=1), name)


def converging(folder: Path, name: str) -> list[object]:
    def run(**named: Any) -> None:
        assert len(list(ts.converge(written(folder), most=1, **named))) == 1

    return [model for _, model in progress_of(run, name)]


def reading_mesh(_: Path, name: str) -> object:
    return ts.read_mesh(EXAMPLES / "mesh.msh", **{name: 2e-3}).nodes.tolist()  # type: ignore[arg-type]


def reading_voxels(_: Path, name: str) -> object:
    return ts.read_voxels(EXAMPLES / "organ.nrrd", 1, edge=0.02, **{name: 2e-3}).nodes.tolist()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("call", "former", "name"),
    [
        (solving, "report", "progress"),
        (calibrating, "report", "progress"),
        (converging, "report", "progress"),
        (reading_mesh, "scale", "unit"),
        (reading_voxels, "scale", "unit"),
    ],
)
def test_a_former_argument_warns_and_works(
    call: Callable[[Path, str], object], former: str, name: str, tmp_path: Path
) -> None:
    with pytest.warns(DeprecationWarning, match=f"{name}="):
        found = call(tmp_path, former)
    assert found == call(tmp_path, name)


def test_a_sweep_is_used_as_a_table_as_before() -> None:
    records = {
        name: {"values": {"material.young": young}, "status": "failed", "reason": name, "summary": None}
        for name, young in (("b", 2.0), ("a", 1.0), ("c", 3.0))
    }
    sweep: Any = Sweep(SimpleNamespace(keys=("material.young",)), records, 0, ())  # type: ignore[arg-type]
    uses: list[Callable[[Any], object]] = [
        len,
        lambda table: [column.to_list() for column in table],
        lambda table: "status" in table,
        lambda table: "rules" in table,
        lambda table: table["reason"].to_list(),
        lambda table: table.columns,
        lambda table: table.shape,
        lambda table: table.to_dicts(),
    ]
    for use in uses:
        with pytest.warns(DeprecationWarning, match=r"table\(\)"):
            found = use(sweep)
        assert found == use(sweep.table())
    assert len(sweep.rows) == 3 and sweep
