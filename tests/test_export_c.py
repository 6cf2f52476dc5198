"""The C runtime: forces, steps and equilibria are ours, each number counts, and damaged data is an error with words."""

import shutil
import struct
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from tests import test_export_gaussian as gaussian
from tests.c_runtime import (
    FLAGS,
    SOURCES,
    arrays,
    compiled,
    data_of,
    error_of,
    files_of,
    layout,
    library,
    needs_compiler,
    opened,
    summed,
    with_entry,
)
from tests.exports import CASES, exported
from tests.test_examples import EXAMPLES
from truespring.arrays import Floats
from truespring.exports import Exported, solve_springs
from truespring.live import Live
from truespring.study import read_study

pytestmark = needs_compiler

_BOX, _STRIP = ts.box(size=(0.04, 0.02, 0.02), elements=(4, 2, 2)), ts.rectangle(size=(0.04, 0.02), elements=(4, 2))
_TRIANGLES = ts.rectangle(size=(0.04, 0.02), elements=(4, 2), element="triangle")
_TETRAHEDRA = ts.box(size=(0.04, 0.02, 0.02), elements=(4, 2, 2), element="tetrahedron")
_SHEET, _SLICE = ts.PlaneStress(0.01), ts.PlaneStrain(0.01)
_CONSTANTS = {"jm": 30.0, "c20": 400.0, "c30": 50.0, "locking_stretch": 1.8}
_MATERIAL = ts.Material(10e3, 0.4, density=1100.0, constants=_CONSTANTS)

#: Mesh, section and springs.
BODIES: dict[str, tuple[ts.Mesh, Any, Any]] = {
    "springs": (_BOX, None, ts.Springs("isotropic")),
    "force law": (_BOX, None, ts.Springs("isotropic", law="neo-hookean")),
    "force law in the plane": (_STRIP, _SHEET, ts.Springs("isotropic", law="neo-hookean")),
    "volume": (_BOX, None, ts.Springs("isotropic", volume=True)),
    "area": (_STRIP, _SLICE, ts.Springs("isotropic", volume=True)),
    "biquadratic": (_BOX, None, ts.Springs("biquadratic")),
    "biquadratic triangles": (_TRIANGLES, _SHEET, ts.Springs("biquadratic")),
    "biquadratic, mixed": (gaussian._MIXED, _SHEET, ts.Springs("biquadratic")),
    "tetrahedra": (_TETRAHEDRA, None, ts.Springs("gaussian")),
    "triangles": (_TRIANGLES, _SLICE, ts.Springs("gaussian")),
    "yeoh": (_BOX, None, ts.Springs("gaussian", law="yeoh")),
    "yeoh in plane stress": (_STRIP, _SHEET, ts.Springs("gaussian", law="yeoh")),
    "gent in plane stress": (_STRIP, _SHEET, ts.Springs("gaussian", law="gent")),
    "arruda-boyce": (_TRIANGLES, _SLICE, ts.Springs("gaussian", law="arruda-boyce")),
}
ALL = (*BODIES, *(f"gaussian: {name}" for name in gaussian.BODIES), *(f"case: {name}" for name in CASES))


@cache
def solved(name: str) -> Exported:
    if name.startswith("gaussian: "):
        return gaussian.solved(name.removeprefix("gaussian: "))
    if name.startswith("case: "):
        return exported(name.removeprefix("case: "))
    mesh, section, springs = BODIES[name]
    problem = ts.Problem(
        mesh,
        _MATERIAL,
        section,
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.01, 0.03, 0.01)[: mesh.dim])],
    )
    return solve_springs(problem, springs, ts.Newton(load_steps=1))


def deformed(nodes: Floats, seed: int = 3) -> Floats:
    """Positions after a large deformation and a small disorder."""
    rng = np.random.default_rng(seed)
    change = np.eye(nodes.shape[1]) + 0.3 * rng.random((nodes.shape[1],) * 2)
    return nodes @ change + 0.01 * np.ptp(nodes) * rng.random(nodes.shape)


@pytest.mark.parametrize("name", ALL)
def test_forces_and_energy_are_ours(name: str) -> None:
    one = solved(name)
    potential = one.path.potential
    assert potential is not None
    x = deformed(potential.nodes)
    with opened(data_of(one)) as body:
        energy, force = body.at(x).force()
        expected = potential.gradient(x)
        assert np.abs(force[:, : x.shape[1]] - expected).max() < 1e-12 * np.abs(expected).max() > 0
        assert not force[:, x.shape[1] :].any()
        assert energy == pytest.approx(potential.energy(x), rel=1e-11)
        assert body.call("energy") == energy


def moving(one: Exported, springs: Any, n: int, alpha: float) -> tuple[float, list[Any]]:
    """The step, and the states of our motion of n steps from the undeformed body, under loads that grow evenly."""
    with opened(data_of(one)) as body:
        h = body.call("step_length")
    dynamics = ts.Dynamics(n * h, h, "leapfrog", ts.Damping(mass=alpha), record=h)
    problem, growing = one.problem, [[0.0, 0.0], [n * h, 1.0]]
    assert problem.material is not None
    moved = replace(
        problem,
        material=replace(problem.material, density=problem.material.density or 1000.0),
        supports=[replace(own, over=growing) if own.displacement is not None else own for own in problem.supports],
        loads=[replace(load, over=growing) for load in problem.loads],
        dynamics=dynamics,
    )
    return h, list(ts.solve(moved, springs).states)


@pytest.mark.parametrize("alpha", [0.0, 30.0])
@pytest.mark.parametrize("name", ["case: moved", "volume", "biquadratic", "tetrahedra", "yeoh"])
def test_steps_are_those_of_our_motion(name: str, alpha: float) -> None:
    """Also of supports that move."""
    one, n = solved(name), 40
    h, states = moving(one, BODIES[name][2] if name in BODIES else one.path.potential, n, alpha)
    dim = one.problem.mesh.dim
    assert len(states) == n + 1
    with opened(data_of(one)) as body:
        body.call("damping", alpha)
        body.call("reset", 0.0)
        moved, fast = np.abs(states[-1].displacement).max(), np.abs(states[-1].moving.velocity).max()
        for number, state in enumerate(states[1:], start=1):
            body.call("share", number / n)
            assert body.call("step", h) == 0
            assert np.abs(body.x[:, :dim] - state.positions).max() < 1e-10 * moved > 0
            assert np.abs(body.v[:, :dim] - state.moving.velocity).max() < 1e-10 * fast > 0
        assert body.call("time") == pytest.approx(n * h)
        assert body.call("kinetic_energy") == pytest.approx(states[-1].moving.energies.kinetic, rel=1e-9)
        assert body.call("energy") == pytest.approx(states[-1].energy, rel=1e-9)


def test_second_order_elements_move_as_ours() -> None:
    mesh, section, rule = gaussian.BODIES["ten nodes"]
    problem = ts.Problem(mesh, _MATERIAL, section, [ts.Fixed("left")], [ts.Force("right", (0.02, 0.03, 0.01))])
    one = solve_springs(problem, ts.Springs("gaussian", **rule), ts.Newton(load_steps=1))
    with opened(data_of(one)) as body:
        h = body.call("step_length")
        dynamics = ts.Dynamics(20 * h, h, "leapfrog", record=5 * h)
        states = ts.solve(replace(problem, dynamics=dynamics), ts.Springs("gaussian", **rule)).states
        for _ in range(20):
            body.call("step", h)
        moved = np.abs(states[-1].displacement).max()
        assert np.abs(body.x - states[-1].all_positions).max() < 1e-10 * moved > 0


def test_semi_implicit_steps_by_hand() -> None:
    one = solved("tetrahedra")
    potential, mass = one.path.potential, one.problem.mass[:, None]
    assert potential is not None
    free, force = ~one.held, one.external_force
    x, v = potential.nodes.copy(), np.zeros_like(potential.nodes)
    with opened(data_of(one)) as body:
        h = body.call("step_length")
        body.call("damping", 20.0)
        for _ in range(10):
            assert body.call("step_euler", h) == 0
            v = np.where(free, (v + h * (force - potential.gradient(x)) / mass) / (1 + h * 20.0), 0.0)
            x = x + h * v
        assert np.abs(body.x - x).max() < 1e-12 * np.abs(x - potential.nodes).max() > 0


def away(one: Exported, x: Floats) -> float:
    """The largest distance from our equilibrium over the largest displacement."""
    state = one.state
    assert state is not None
    ours = state.all_positions
    nodes = one.path.potential.nodes  # type: ignore[union-attr]
    return float(np.abs(x[:, : ours.shape[1]] - ours).max() / np.abs(ours - nodes).max())


def settled(one: Exported, most: int = 200_000, tolerance: float = 1e-10, real: str = "double") -> tuple[int, float]:
    """The number of steps in which the body settles from rest without load, and its distance from ours."""
    with opened(data_of(one), real) as body:
        body.call("reset", 0.0)
        steps = body.call("settle", tolerance, most)
        return steps, away(one, body.x)


@pytest.mark.parametrize(
    "name", ["case: bending", "case: moved", "case: turned", "case: prestressed", "volume", "biquadratic", "yeoh"]
)
def test_it_settles_on_our_equilibrium(name: str) -> None:
    steps, distance = settled(solved(name))
    assert steps > 0 and distance < 1e-6


def test_a_body_starts_at_our_equilibrium_and_stays_there() -> None:
    one = solved("yeoh")
    with opened(data_of(one)) as body:
        assert body.call("start") == 0
        assert away(one, body.x) == 0
        for _ in range(20):
            body.call("step", body.call("step_length"))
        assert away(one, body.x) < 1e-6


def test_a_body_without_equilibrium_says_so() -> None:
    one = solved("springs")
    unsolved = replace(one, path=replace(one.path, states=one.path.states[:1], status=ts.Status.NOT_CONVERGED))
    data = data_of(unsolved)
    assert "equilibrium" not in layout(data)
    with opened(data) as body:
        code = body.call("start")
    assert code < 0 and "full load was not reached" in library().driver_text(code).decode()


@pytest.mark.verification  # compiles the runtime again
def test_single_precision() -> None:
    one = solved("tetrahedra")
    x = deformed(one.problem.mesh.nodes)
    with opened(data_of(one), "float") as body:
        _, force = body.at(x).force()
    expected = one.path.potential.gradient(x)  # type: ignore[union-attr]
    assert 1e-10 < np.abs(force - expected).max() / np.abs(expected).max() < 1e-4
    steps, distance = settled(one, tolerance=1e-4, real="float")
    assert steps > 0 and distance < 1e-3


# --- grasps and spheres ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plane", [False, pytest.param(True, marks=pytest.mark.verification)])
def test_grasps_and_spheres_are_those_of_a_live_session(plane: bool) -> None:
    mesh, section = (_STRIP, _SLICE) if plane else (_BOX, None)
    dim = mesh.dim
    pull = ts.Force("right", (0.01, 0.01, 0.0)[:dim])
    problem = ts.Problem(mesh, _MATERIAL, section, [ts.Fixed("left")], [pull])
    springs = ts.Springs("gaussian")
    corner = (0.04, 0.02, 0.02)[:dim]
    data = data_of(solve_springs(problem, springs, ts.Newton(load_steps=1)))
    with opened(data) as body:
        frame = 2.2 * body.call("step_length")
    live = Live(replace(problem, dynamics=ts.Dynamics(1.0)), springs, frame=frame, scheme="leapfrog")
    forces: dict[str, list[Any]] = {"pull": [], "sphere": []}
    ball, edge = np.array((0.02, 0.034, 0.01)), 0.016
    with opened(data) as body:
        for number in range(8):
            place = np.array((0.04 + 0.0005 * number, 0.021, 0.02))
            centre = ball - (0, 0.0002 * number, 0)
            live.pull(corner, to=place[:dim].tolist(), stiffness=5.0)
            live.push(centre[:dim].tolist(), radius=edge)
            live.step()
            flat = np.r_[corner, [0.0] * (3 - dim)]
            target = np.where(np.arange(3) < dim, place, 0.0)
            assert body.call("pull", 0, flat, target, 0.0, 5.0) == 0
            assert body.call("sphere", 0, np.where(np.arange(3) < dim, centre, 0.0), edge, 0.0) == 0
            assert body.call("advance", frame) == live.steps_a_frame
            moved = np.abs(live.positions - mesh.nodes).max()
            assert np.abs(body.x[:, :dim] - live.positions).max() < 1e-10 * moved > 0
            for kind, name in (("grip_force", "pull"), ("sphere_force", "sphere")):
                forces[name].append((body.array(kind, 0, shape=(3,))[:dim].copy(), live.forces[name]))
        for found, expected in (np.swapaxes(several, 0, 1) for several in forces.values()):
            assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max() > 0
        body.call("release", 0)
        body.call("sphere", 0, None, 0.0, 0.0)
        body.call("step", 1e-6)
        assert not body.array("grip_force", 0, shape=(3,)).any()
        assert not body.array("sphere_force", 0, shape=(3,)).any()


def test_arguments_out_of_range_are_errors() -> None:
    point, nan = np.zeros(3), np.array([np.nan, 0, 0])
    with opened(data_of(solved("tetrahedra"))) as body:
        code = body.call("step", 0.0)
        assert code < 0 and "argument" in library().driver_text(code).decode()
        for call in (
            ("step", float("nan")),
            ("step_euler", -1.0),
            ("advance", 0.0),
            ("advance", 1e9),
            ("settle", 0.0, 10),
            ("settle", 1e-3, 0),
            ("pull", 8, point, point, 0.0, 0.0),
            ("pull", -1, point, point, 0.0, 0.0),
            ("pull", 0, None, point, 0.0, 0.0),
            ("pull", 0, nan, point, 0.0, 0.0),
            ("pull", 0, point, nan, 0.0, 0.0),
            ("pull", 0, point, point, -1.0, 0.0),
            ("sphere", 8, point, 1.0, 0.0),
            ("sphere", 0, None, 1.0, 0.0),
            ("sphere", 0, nan, 1.0, 0.0),
            ("sphere", 0, point, -1.0, 0.0),
        ):
            assert body.call(*call) == code, call
        assert body.call("settle", 1e-12, 3) < 0  # it has not settled
    with opened(data_of(solved("case: two springs"))) as network:
        assert network.call("pull", 0, point, None, 1.0, 0.0) == code  # there is no Young's modulus
        assert network.call("pull", 0, point, None, 1.0, 5.0) == 0


def test_an_inverted_element_unfolds() -> None:
    """The pressure is finite in an inverted element, and it pushes."""
    one = solved("tetrahedra")
    nodes = one.problem.mesh.nodes
    with opened(data_of(one)) as body:
        turned, mesh = nodes.copy(), one.problem.mesh
        corner = len(nodes) - 1
        others = nodes[next(own for own in mesh.elements if corner in own)].sum(axis=0) - nodes[corner]
        turned[corner] += 1.1 * (others / 3 - nodes[corner])  # through the opposite face
        assert one.problem.mesh.smallest_area_ratio(turned) < 0
        body.at(turned)
        assert np.isfinite(body.force()[1]).all()
        assert body.call("settle", 1e-9, 100_000) > 0
        assert away(one, body.x) < 1e-6


# --- each number counts ----------------------------------------------------------------------------------------------


def signature(data: bytes) -> Floats:
    """Forces, energy, and positions after grasps, a sphere and a few steps."""
    with opened(data) as body:
        nodes = arrays(data)["rest"].reshape(-1, 3)
        probe, size = nodes[body.call("probe")], float(np.ptp(nodes))
        energy, force = body.at(deformed(nodes) * (np.ptp(nodes, axis=0) > 0)).force()
        body.call("reset", 1.0)
        body.call("pull", 0, probe, probe + 0.1 * size, 0.0, 0.0)
        body.call("pull", 1, probe, probe + 0.1 * size, 10 * size, 1.0)
        body.call("sphere", 0, probe, 0.3 * size, 0.0)
        for _ in range(3):
            body.call("step", body.call("step_length"))
        found = [force.ravel(), [energy], body.x.ravel().copy(), [body.call("patch"), body.call("stable_step")]]
        if body.call("start") == 0:
            found.append(body.x.ravel())
        return np.concatenate(found)


def entries(name: str, values: Any, n: int) -> list[list[int]]:
    """Places of nonzero entries of an array, of which one must be seen; of constants for each column of n rows."""
    columns = len(values) // n if name.endswith("constants") else 1
    found = []
    for column in range(columns):
        own = np.flatnonzero(values[column::columns]) * columns + column
        if len(own):
            places = {int(own[np.abs(values[own]).argmax()]), *(int(own[k]) for k in (0, len(own) // 2, -1))}
            found.append(sorted(places))
    return found


#: A body that has each array.
_WITH_ARRAYS = (
    "case: moved",
    "gaussian: mixed",
    "gaussian: fibres",
    "yeoh",
    "biquadratic",
    "gaussian: ten nodes",
    "volume",
)


@pytest.mark.parametrize("name", _WITH_ARRAYS)
def test_a_number_that_changes_is_seen(name: str) -> None:
    data = data_of(solved(name))
    before, found = signature(data), arrays(data)
    unused = {"thickness"} if solved(name).problem.mesh.dim == 3 else set()
    unused |= {"young"} if not solved(name).problem.materials else set()
    for array, values in found.items():
        if values.dtype != np.float64 or array in unused:
            continue
        if array.endswith("scale") and found[array.replace("scale", "counts")][5] == 1:
            continue  # not used by hexahedra
        n = int(found[array.split(".")[0] + ".counts"][1]) if "." in array else len(values)
        for places in entries(array, values, n):
            assert any(
                differ(before, signature(with_entry(data, array, place, 1.01 * values[place]))) for place in places
            ), array


def differ(one: Floats, other: Floats) -> bool:
    return bool((np.abs(other - one) > 1e-9 * np.abs(one) + 1e-13 * np.abs(one).max()).any())


def test_the_data_holds_our_numbers() -> None:
    one = solved("case: block")
    found = arrays(data_of(one))
    volume = 0.08 * 0.04 * 0.02
    assert found["mass"].sum() == pytest.approx((1100.0 + 900.0) / 2 * volume, rel=1e-12)
    assert found["rest"].reshape(-1, 3).tolist() == one.problem.mesh.nodes.tolist()
    assert found["load"].reshape(-1, 3) == pytest.approx(one.external_force, abs=1e-15)
    assert found["held"].tolist() == (7 * one.held.all(axis=1)).tolist()
    assert found["areas"].sum() == pytest.approx(2 * (0.08 * 0.04 + 0.08 * 0.02 + 0.04 * 0.02))
    assert found["0.nodes"].reshape(-1, 2).tolist() == one.springs.arrays["springs"].tolist()
    assert found["young"] == [20e3]
    flat = arrays(data_of(solved("case: moved")))
    assert (flat["held"] & 4 == 4).all()  # it stays in its plane
    held = solved("case: moved").held
    assert (flat["held"] & 3).tolist() == (held @ [1, 2]).tolist()


# --- damaged data ----------------------------------------------------------------------------------------------------


def _changed(data: bytes, at: int, value: bytes) -> bytes:
    return data[:at] + value + data[at + len(value) :]


def _entry(name: str, value: float, index: int = 0) -> Callable[[bytes], bytes]:
    return lambda data: with_entry(data, name, index, value)


#: How data is damaged, and words of the error.
DAMAGE: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "empty": (lambda data: b"", "not a body"),
    "foreign": (lambda data: b"\x89PNG\r\n\x1a\n" + data[8:], "not a body"),
    "head cut": (lambda data: data[:20], "cut off"),
    "cut": (lambda data: data[:-8], "cut off"),
    "longer": (lambda data: data + b"\0" * 8, "longer"),
    "cut, summed": (lambda data: summed(data[:-8]), "cut off"),
    "longer, summed": (lambda data: summed(data + b"\0" * 8), "longer"),
    "other byte order": (lambda data: _changed(data, 8, bytes([1, 2, 3, 4])), "little-endian"),
    "other version": (lambda data: _changed(data, 12, struct.pack("<I", 2)), "another version"),
    "a bit": (lambda data: _changed(data, 1000, bytes([data[1000] ^ 1])), "checksum"),
    "node of an element": (_entry("1.nodes", 10**6), "node number is out of range"),
    "node of a spring": (_entry("0.nodes", 45, 7), "node number is out of range"),
    "local node": (_entry("1.simplices", 4), "node number is out of range"),
    "node of the surface": (_entry("surface", 2**32 - 1), "node number is out of range"),
    "held": (_entry("held", 8), "out of range"),
    "no mass": (_entry("mass", 0.0), "not positive"),
    "no volume": (_entry("1.volume", -1.0), "not positive"),
    "not finite": (_entry("0.stiffness", float("nan")), "not finite"),
    "step": (_entry("stable_step", 0.0), "not positive"),
    "kind": (_entry("1.counts", 9), "unknown kind"),
    "corners": (_entry("1.counts", 200, 2), "unknown kind"),
    "law": (_entry("1.counts", 4, 3), "unknown kind"),
    "form": (_entry("1.counts", 1, 5), "unknown kind"),
    "links": (_entry("1.counts", 2**31, 7), "unknown kind"),
    "very many": (_entry("0.counts", 2**32 - 1, 1), "cut off"),
    "very many nodes": (lambda data: summed(_changed(data, 32, struct.pack("<I", 2**32 - 1))), "cut off"),
    "no nodes": (lambda data: summed(_changed(data, 32, struct.pack("<I", 0))), "out of range"),
    "groups": (lambda data: summed(_changed(data, 44, struct.pack("<I", 1000))), "too many groups"),
}


@pytest.mark.parametrize("how", DAMAGE)
def test_damaged_data_is_an_error_with_words(how: str) -> None:
    change, words = DAMAGE[how]
    code, text = error_of(change(data_of(solved("tetrahedra"))))
    assert code < 0 and words in text


def test_memory_that_is_too_small_or_not_aligned_is_an_error() -> None:
    import ctypes

    data, lib = data_of(solved("tetrahedra")), library()
    texts = {}
    for name, missing, shift in (("small", 1, 0), ("shifted", 0, 4), ("enough", 0, 0)):
        code = lib.driver_open_in(ctypes.c_size_t(missing), ctypes.c_size_t(shift), data, ctypes.c_size_t(len(data)))
        texts[name] = lib.driver_text(code).decode()
    assert "too small" in texts["small"] and "not aligned" in texts["shifted"] and texts["enough"] == "no error"


def test_each_code_has_a_text_of_its_own() -> None:
    texts = [library().driver_text(-code).decode() for code in range(1, 16)]
    assert len(set(texts)) == 15 and "unknown error" not in texts
    assert library().driver_text(-16).decode() == "unknown error"


# --- the files -------------------------------------------------------------------------------------------------------


def test_the_program_settles_and_prints(tmp_path: Path) -> None:
    """As the page says: cc main.c; also in C++ where a compiler is."""
    files = files_of(exported("bending"))
    assert "Case: bending" in files["truespring.h"] and "largest stable step" in files["truespring.h"]
    program = compiled(files["truespring.h"], files["main.c"], tmp_path, *FLAGS)
    (tmp_path / "body.bin").write_bytes(files["body.bin"])
    done = subprocess.run([program, tmp_path / "body.bin"], capture_output=True, text=True, check=True)
    settled_, found, wanted = done.stdout.splitlines()
    numbers = [np.array(line.split(": ")[1].split()[:3], dtype=float) for line in (found, wanted)]
    assert "settled in" in settled_ and np.abs(numbers[0] - numbers[1]).max() < 1e-6 * np.abs(numbers[1]).max()
    (tmp_path / "body.bin").write_bytes(files["body.bin"][:-1])
    done = subprocess.run([program, tmp_path / "body.bin"], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "cut off" in done.stderr
    assert subprocess.run([program, tmp_path / "none"], capture_output=True, check=False).returncode == 2


@pytest.mark.parametrize("compiler", ["cc", "c++"])
def test_a_title_cannot_end_the_comment_in_c_and_in_cpp(compiler: str, tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"no compiler: {compiler} is not installed")
    one = replace(exported("two springs"), title='*/ int main; /* " \\ ??/')
    files, flags = files_of(one), ("-Wall", "-Wextra", "-Werror", "-fsyntax-only")
    language = ("-std=c99", "-pedantic") if compiler == "cc" else ("-x", "c++")
    compiled(files["truespring.h"], files["main.c"], tmp_path, *flags, *language, compiler=compiler)


# --- shipped bodies, and fuzzing: long -------------------------------------------------------------------------------


def _study(stem: str, model: str) -> Exported:
    study = read_study(EXAMPLES / f"{stem}.toml")
    return solve_springs(study.problem, study.entries[model], study.solver, study.title)


@pytest.mark.verification
@pytest.mark.parametrize(
    ("stem", "model"),
    [
        ("bending", "springs"),
        ("bending", "gaussian"),
        ("soft_block", "gaussian"),
        ("soft_block", "springs"),
        ("tissue", "gaussian"),
        ("tissue", "biquadratic"),
        ("tissue", "lloyd"),
        ("organ", "gaussian"),
    ],
)
def test_shipped_bodies_settle_on_our_equilibrium(stem: str, model: str) -> None:
    steps, distance = settled(_study(stem, model), most=1_000_000)
    assert steps > 0 and distance < 1e-6


@pytest.mark.verification
@pytest.mark.parametrize("name", [*_WITH_ARRAYS, "case: bending", "gent in plane stress", "tetrahedra"])
def test_damaged_data_never_leaves_its_memory(name: str, tmp_path: Path) -> None:
    """Under the sanitizers of addresses and undefined behaviour."""
    files = files_of(solved(name))
    sanitizers = ("-O1", "-g", "-std=c99", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    program = compiled(files["truespring.h"], (SOURCES / "fuzz.c").read_text("utf-8"), tmp_path, *sanitizers)
    (tmp_path / "body.bin").write_bytes(files["body.bin"])
    command = [str(program), str(tmp_path / "body.bin"), "1", "20000"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    assert int(done.stdout.split()[0]) > 100
