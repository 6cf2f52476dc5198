"""Networks from CSV files, and mechanisms."""

from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.errors import TruespringError
from truespring.study import read_network, read_study, run

NODES = "node,x [mm],y [mm]\na,0,0\nb,1000,0\nc,500,400\n"
SPRINGS = "a,b,stiffness [N/mm],rest_length [m]\na,c,2,0.6\nc,b,3,0.65\n"


def files(folder: Path, nodes: str = NODES, springs: str = SPRINGS) -> tuple[Path, Path]:
    (folder / "nodes.csv").write_text(nodes, encoding="utf-8")
    (folder / "springs.csv").write_text(springs, encoding="utf-8")
    return folder / "nodes.csv", folder / "springs.csv"


def test_names_and_units_are_understood(tmp_path: Path) -> None:
    network = read_network(*files(tmp_path))
    assert network.nodes == pytest.approx(np.array([[0, 0], [1, 0], [0.5, 0.4]]))
    assert network.springs.tolist() == [[0, 2], [2, 1]]
    assert network.stiffness == pytest.approx([2000, 3000]) and network.rest_length == pytest.approx([0.6, 0.65])


def test_numbers_in_si_are_enough(tmp_path: Path) -> None:
    network = read_network(*files(tmp_path, "x,y,z\n0,0,0\n1,0,0\n", "a,b,stiffness\n0,1,5\n"))
    assert network.nodes.shape == (2, 3) and network.rest_length == pytest.approx([1.0])


def test_a_motion_needs_masses_which_the_file_of_the_nodes_may_have(tmp_path: Path) -> None:
    """Free masses under no load but a velocity keep it; without masses the study names the column."""
    heavy = NODES.replace("y [mm]", "y [mm],mass [g]").replace("0\n", "0,20\n")
    network = read_network(*files(tmp_path, heavy))
    assert network.mass == pytest.approx([0.02] * 3)
    springs = SPRINGS.replace(",rest_length [m]", "").replace(",0.6\n", "\n").replace(",0.65\n", "\n")
    models = '[mesh]\nnodes = "nodes.csv"\nsprings = "springs.csv"\n[models.net]\nkind = "network"\n'
    moves = '[dynamics]\nduration = "0.1 s"\nstep = "10 ms"\nscheme = "midpoint"\nvelocity = ["1 m/s", 0]\n'
    study = tmp_path / "study.toml"
    study.write_text(models + moves, encoding="utf-8")
    files(tmp_path, heavy, springs)
    (path,) = run(read_study(study)).solutions.values()
    assert path.states[-1].displacement == pytest.approx(np.tile([0.1, 0.0], (3, 1)))
    files(tmp_path, NODES, springs)
    with pytest.raises(TruespringError, match=r"mesh\.nodes: a motion needs the mass of the nodes: add a column mass"):
        read_study(study)
    light = read_network(*files(tmp_path, NODES, springs))
    problem = ts.Problem(light.mesh, dynamics=ts.Dynamics(0.1, 0.01, "midpoint"))
    with pytest.raises(TruespringError, match=r"mass of the nodes.*SpringNetwork.*mass="):
        ts.solve(problem, light)
    with pytest.raises(TruespringError, match=r"nodes.csv:3: mass = -1 kg: must be positive"):
        read_network(*files(tmp_path, "x,y,mass\n0,0,1\n1,0,-1\n", "a,b,stiffness\n0,1,5\n"))


WRONG = {
    "missing column": ({"nodes": "node,x\na,0\n"}, r"nodes.csv:1: column y "),
    "misspelt column": (
        {"springs": "a,b,stifness\na,b,1\n"},
        r"springs.csv:1: column 'stifness' is unknown.*stiffness",
    ),
    "no number": ({"nodes": "x,y\n0,zero\n"}, r"nodes.csv:2: y = 'zero' "),
    "unknown node": ({"springs": "a,b,stiffness\na,d,1\n"}, r"springs.csv:2: b = 'd' "),
    "node twice": ({"nodes": NODES + "a,1,1\n"}, "nodes.csv: node a .*twice"),
    "row too short": ({"springs": "a,b,stiffness\na,b\n"}, "springs.csv:2: 2 values.* 3 columns"),
    "empty": ({"nodes": ""}, "nodes.csv: .*at least one row"),
    "unit of another kind": ({"nodes": "x [N],y\n0,0\n"}, "nodes.csv:1: x: "),
    "spring of no length": ({"springs": "a,b,stiffness\na,a,1\n"}, "springs.csv: "),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_damaged_is_refused_with_its_place(name: str, tmp_path: Path) -> None:
    given, message = WRONG[name]
    with pytest.raises(TruespringError, match=message):
        read_network(*files(tmp_path, **given))


# --- mechanisms ---------------------------------------------------------------------------------------------------


def frame(*more: tuple[int, int]) -> ts.SpringNetwork:
    """Four bars around a square, and more."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    springs = [(0, 1), (1, 2), (2, 3), (3, 0), *more]
    return ts.SpringNetwork(nodes, springs, np.ones(len(springs)))


def test_a_mechanism_is_refused_by_its_nodes() -> None:
    loose, braced = frame(), frame((0, 2))
    problem = ts.Problem(loose.mesh, supports=ts.Fixed([0, 1]), loads=ts.Force([2], (0.1, 0.0)))
    with pytest.raises(TruespringError, match="mechanism: nodes 2, 3 "):
        ts.solve(problem, loose)
    assert ts.solve(problem, braced).complete


def test_a_chain_that_its_tension_holds_is_none() -> None:
    """Pulled sideways, a straight chain has no stiffness at rest, but stiffens as it moves."""
    chain = ts.SpringNetwork([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0, 1], [1, 2]], [5.0, 5.0])
    problem = ts.Problem(chain.mesh, supports=ts.Fixed([0, 2]), loads=ts.Force([1], (0.0, 0.1)))
    path = ts.solve(problem, chain)
    height = path.states[-1].displacement[1, 1]
    assert 2 * 5 * (np.hypot(1, height) - 1) * height / np.hypot(1, height) == pytest.approx(0.1)


def test_a_chain_that_hangs_from_one_end_is_one() -> None:
    chain = ts.SpringNetwork([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0, 1], [1, 2]], [5.0, 5.0])
    problem = ts.Problem(chain.mesh, supports=[ts.Fixed([0]), ts.Fixed([2], ["y"])], loads=ts.Force([1], (0.0, 0.1)))
    with pytest.raises(TruespringError, match="mechanism: node 1 "):
        ts.solve(problem, chain)
