"""Spring models to be carried to other simulators, each with something of its own, and what a file says of them."""

import importlib.util
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np

import truespring as ts
from tests.test_examples import EXAMPLES
from truespring.arrays import Floats
from truespring.exports import Exported, solve_springs
from truespring.models import SpringNetwork, Springs
from truespring.study import read_study

_SOFT = ts.Material(young=10e3, poisson=1 / 3)
_STRIP = ts.rectangle(size=(0.08, 0.04), elements=(8, 4))
_SHEET = ts.PlaneStress(thickness=0.01)


def _bending() -> tuple[ts.Problem, Springs]:
    study = read_study(EXAMPLES / "bending.toml")
    springs = study.entries["springs"]
    assert isinstance(springs, Springs)
    return study.problem, springs


def _two_springs(rest: float = 10.0) -> tuple[ts.Problem, SpringNetwork]:
    """Ansys verification manual VM9."""
    network = ts.SpringNetwork([[0.0, 10.0], [0.0, 0.0], [0.0, -10.0]], [[0, 1], [1, 2]], [8.0, 1.0], [rest, rest])
    return ts.Problem(network.mesh, supports=[ts.Fixed([0, 2])], loads=[ts.Force([1], (5.0, 5.0))]), network


def _block() -> tuple[ts.Problem, Springs]:
    """In space, of two materials, under its weight and a pull."""
    problem = ts.Problem(
        mesh=ts.box(size=(0.08, 0.04, 0.02), elements=(4, 2, 1)),
        material=ts.Material(young=10e3, poisson=0.25, density=1100.0),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Gravity((0.0, -9.81, 0.0)), ts.Force(on="right", total=(0.4, 0.0, 0.3))],
        regions=[ts.Region(ts.Box((0.0, 0.0, 0.0), (0.04, 0.04, 0.02)), ts.Material(20e3, 0.25, 900.0))],
    )
    return problem, Springs(rule="isotropic")


def _moved() -> tuple[ts.Problem, Springs]:
    """A strip pulled by its side, which is free to grow thin; held in part below, and pushed from above."""
    supports = [
        ts.Fixed(on="left"),
        ts.Fixed(on="right", fix="x", displacement=(0.02, 0.0)),
        ts.Fixed(on=ts.Near((0.04, 0.0)), fix="y", displacement=(0.0, 0.004)),
    ]
    return ts.Problem(_STRIP, _SOFT, _SHEET, supports, [ts.Traction(on="top", traction=(0.0, -60.0))]), Springs("lloyd")


def _turned() -> tuple[ts.Problem, Springs]:
    supports = [ts.Fixed(on="left"), ts.Fixed(on="right", displacement=(-0.01, 0.02), rotation=0.6)]
    return ts.Problem(_STRIP, _SOFT, _SHEET, supports), Springs("lloyd")


def _pressed() -> tuple[ts.Problem, Springs]:
    """Under a pressure, which follows the body; in plane strain."""
    supports = [ts.Fixed(on="left"), ts.Fixed(on="right")]
    section = ts.PlaneStrain(thickness=0.02)
    return ts.Problem(_STRIP, ts.Material(10e3, 0.25), section, supports, [ts.Pressure("top", 300.0)]), Springs("lloyd")


def _snapping() -> tuple[ts.Problem, SpringNetwork]:
    """The shallow truss of von Mises under more than it bears: it hangs in the end."""
    study = read_study(EXAMPLES / "truss.toml")
    network = study.entries["truss"]
    assert isinstance(network, SpringNetwork)
    return study.problem, network


_CASES = {
    "bending": _bending,
    "two springs": _two_springs,
    "prestressed": lambda: _two_springs(9.0),
    "block": _block,
    "moved": _moved,
    "turned": _turned,
    "pressed": _pressed,
    "snapping": _snapping,
}
CASES = tuple(_CASES)


@cache
def exported(case: str) -> Exported:
    """A case solved up to its full load."""
    problem, springs = _CASES[case]()
    found = solve_springs(problem, springs, ts.Newton(load_steps=5), f'Case: {case} -- <&> "quoted"')
    assert found.path.status is ts.Status.CONVERGED
    return found


def expected(case: str) -> Floats:
    """Our displacement at full load [m], shape (n_nodes, dim)."""
    state = exported(case).state
    assert state is not None
    return state.displacement


def difference(displacement: Floats, case: str) -> float:
    """The largest distance from our displacement, over the largest of it."""
    ours = expected(case)
    largest = np.linalg.norm(ours, axis=1).max()
    return float(np.linalg.norm(displacement[:, : ours.shape[1]] - ours, axis=1).max() / largest)


def write(files: Mapping[str, str | bytes], folder: Path) -> Path:
    """Write files of a target; return the folder."""
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


def imported(file: Path) -> ModuleType:
    """Import a file as a module of its own, with modules of its folder."""
    spec = importlib.util.spec_from_file_location(f"{file.stem}_{abs(hash(str(file)))}", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    sys.path.insert(0, str(file.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(file.parent))
        for name in [path.stem for path in file.parent.glob("*.py") if path != file]:
            sys.modules.pop(name, None)
    return module
