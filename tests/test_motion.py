"""Motion in time, against closed forms, matrix exponentials and eigenvalue problems."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh, expm
from scipy.special import ellipk

import truespring as ts
from truespring.dynamics import SCHEMES
from truespring.errors import TruespringError
from truespring.motion.stages import ORDERS

NEWTON = ts.Newton(tolerance=1e-12)
G = 9.81
LONG = pytest.mark.verification


def oscillator(dynamics: ts.Dynamics, stiffness: float = 4.0, mass: float = 1.0) -> ts.Solution:
    """A mass on a spring along x."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0]])
    network = ts.SpringNetwork(nodes, np.array([[0, 1]]), np.array([stiffness]), mass=np.full(2, mass))
    supports = [ts.Fixed(on=[0]), ts.Fixed(on=[1], fix=["y"])]
    problem = ts.Problem(network.mesh, supports=supports, dynamics=dynamics)
    return ts.solve(problem, network, NEWTON)


def energies(path: ts.Solution) -> np.ndarray:
    return np.array([state.moving.energies.total for state in path.states])


def test_the_energy_of_an_oscillator_decays_as_the_scheme_says() -> None:
    h, omega, n = 0.1, 2.0, 50
    y = omega * h

    def total(scheme: str) -> np.ndarray:
        dynamics = ts.Dynamics(n * h, step=h, scheme=scheme, velocity=(0.01, 0.0), record=h)
        path = oscillator(dynamics)
        assert path.status is ts.Status.CONVERGED and len(path.states) == n + 1
        return energies(path)

    assert total("euler")[-1] / total("euler")[0] == pytest.approx((1 + y**2) ** -n, rel=1e-10)
    assert total("midpoint")[-1] / total("midpoint")[0] == pytest.approx(1, abs=1e-10)
    root = max(np.abs(np.roots([1.5 - 1j * y, -2, 0.5])))
    bdf2 = total("bdf2")
    assert bdf2[40] / bdf2[30] == pytest.approx(root**20, rel=1e-10)  # the second root has died out
    # Leapfrog keeps v^2 (1 - (omega h / 2)^2) + (omega x)^2 at full steps exactly: here by its discrete energy.
    path = oscillator(ts.Dynamics(n * h, step=h, scheme="leapfrog", velocity=(0.01, 0.0), record=h))
    x = np.array([state.displacement[1, 0] for state in path.states])
    v = np.array([state.moving.velocity[1, 0] for state in path.states])
    kept = v**2 + (1 - (y / 2) ** 2) * (omega * x) ** 2
    assert kept == pytest.approx(np.full(n + 1, 1e-4), rel=1e-10)


@cache
def chain(step: float, scheme: str) -> np.ndarray:
    """Three masses on springs in the plane, let go from rest under their weight: positions at the end."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
    springs = np.array([[0, 1], [1, 2], [2, 3]])
    network = ts.SpringNetwork(nodes, springs, np.full(3, 60.0), mass=np.ones(4))
    problem = ts.Problem(
        network.mesh,
        supports=[ts.Fixed(on=[0])],
        loads=[ts.Force(on=[node], total=(0.0, -1.0)) for node in (1, 2, 3)],
        dynamics=ts.Dynamics(1.0, step=step, scheme=scheme, record=1.0),
    )
    return ts.solve(problem, network, NEWTON).states[-1].positions


@pytest.mark.parametrize("scheme", ORDERS)
def test_the_order_of_each_scheme(scheme: str) -> None:
    assert set(ORDERS) == set(SCHEMES) - {"auto"}
    exact = (4 * chain(1 / 800, "leapfrog") - chain(1 / 400, "leapfrog")) / 3
    errors = [np.abs(chain(step, scheme) - exact).max() for step in (1 / 50, 1 / 100, 1 / 200)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[scheme], abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(ORDERS[scheme], abs=0.1)


MODELS: dict[str, Callable[[], object]] = {
    "gaussian": lambda: ts.Springs("gaussian"),
    "volume": lambda: ts.Springs("isotropic", volume=True),
    "fem": lambda: ts.Fem("neo-hookean"),
}


@cache
def swung(model: str, n: int, scheme: str) -> np.ndarray:
    """A cantilever that swings in its lowest modes: positions at the end of n steps."""
    slow = [(0.0, 0), (0.1, 0.5), (0.2, 1)]
    problem = ts.Problem(
        ts.rectangle((0.08, 0.04), (4, 2)),
        ts.Material(3e3, 1 / 3, density=1000.0),
        ts.PlaneStress(0.01),
        [ts.Fixed("left")],
        [ts.Force("right", (0.0, -0.02), over=slow)],
        dynamics=ts.Dynamics(0.2, step=0.2 / n, scheme=scheme, record=0.2),
    )
    return ts.solve(problem, MODELS[model](), NEWTON).states[-1].positions


@LONG
@pytest.mark.parametrize("scheme", ORDERS)
@pytest.mark.parametrize("model", MODELS)
def test_the_order_holds_for_every_model(model: str, scheme: str) -> None:
    """Against the motion of small midpoint steps, extrapolated."""
    exact = (4 * swung(model, 1600, "midpoint") - swung(model, 800, "midpoint")) / 3
    errors = [np.abs(swung(model, n, scheme) - exact).max() for n in (200, 400)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[scheme], abs=0.1)


def momenta(path: ts.Solution) -> tuple[np.ndarray, np.ndarray]:
    """Momentum and angular momentum at all recorded times."""
    mass = path.problem.mass[:, None]
    linear = np.array([(mass * state.moving.velocity).sum(axis=0) for state in path.states])
    angular = np.array([np.cross(state.positions, mass * state.moving.velocity).sum(axis=0) for state in path.states])
    return linear, angular


@pytest.mark.parametrize("damping", [0.0, pytest.param(2e-3, marks=LONG)])
@pytest.mark.parametrize("model", [pytest.param(one, marks=[] if one == "gaussian" else LONG) for one in MODELS])
@pytest.mark.verification
def test_a_free_body_keeps_its_momenta(model: str, damping: float) -> None:
    """A body that was spun by a moment and pulled for a while flies on freely; damping by the material keeps both."""
    pulled = [
        ts.Force(on=side, total=total, over=[(0, 1), (0.02, 1), (0.021, 0)])
        for side, total in (("top", (8, 0, 0)), ("bottom", (-8, 0, 0)), ("right", (0, 0, 1)))
    ]

    def moved(scheme: str) -> ts.Solution:
        dynamics = ts.Dynamics(0.1, step=1e-3, scheme=scheme, damping=ts.Damping(damping), record=0.025)
        cube = ts.box((0.1, 0.1, 0.1), (2, 2, 2))
        material = ts.Material(30e3, 0.3, density=1000.0)
        problem = ts.Problem(cube, material, loads=pulled, dynamics=dynamics)
        return ts.solve(problem, MODELS[model](), NEWTON)

    for scheme in ("euler", "bdf2", "midpoint", "leapfrog"):
        path = moved(scheme)
        assert path.complete, path.warnings
        linear, angular = momenta(path)
        free = slice(2, None)  # after the pull, and the second root of BDF2 has died out
        assert np.abs(np.ptp(linear[free], axis=0)).max() < 1e-10 * np.abs(linear).max()
        if scheme == "midpoint":
            assert np.abs(np.ptp(angular[free], axis=0)).max() < 1e-9 * np.abs(angular).max()
        if scheme == "euler":  # which brakes rotation
            assert np.abs(np.ptp(angular[free], axis=0)).max() > 1e-3 * np.abs(angular).max()


def cantilever(model: object, dynamics: ts.Dynamics | None, load: float = -1e-6, **further: object) -> ts.Solution:
    problem = ts.Problem(
        ts.rectangle((0.16, 0.04), (8, 2)),
        ts.Material(3e3, 0.3, density=1000.0),
        ts.PlaneStress(0.01),
        [ts.Fixed("left")],
        [ts.Force("right", (0.0, load))],
        dynamics=dynamics,
    )
    return ts.solve(problem, model, ts.Newton(tolerance=1e-11, **further))


@pytest.mark.parametrize("model", [ts.Springs("gaussian"), pytest.param(ts.Fem("neo-hookean"), marks=LONG)])
def test_the_first_frequency_of_a_cantilever(model: ts.Fem) -> None:
    """The midpoint rule lengthens a period: it has the frequency (2 / h) atan(omega h / 2)."""
    problem = cantilever(model, None).problem
    problem = replace(problem, dynamics=ts.Dynamics(1.0))
    potential, free = model.potential(problem), ~problem.loading.held.ravel()
    stiffness = potential.hessian(problem.mesh.nodes).toarray()[np.ix_(free, free)]
    mass = np.repeat(problem.mass, 2)[free]
    values, shapes = eigh(stiffness, np.diag(mass), subset_by_index=[0, 0])
    omega, shape = float(np.sqrt(values[0])), shapes[:, 0]
    h = 2 * np.pi / omega / 40
    path = cantilever(model, ts.Dynamics(80 * h, step=h, scheme="midpoint", record=h))
    moved = np.array([shape @ (mass * state.displacement.ravel()[free]) for state in path.states])
    centre = (moved.max() + moved.min()) / 2
    away = moved - centre
    # of a cosine of frequency w at times h: away(t + h) + away(t - h) = 2 cos(w h) away(t)
    cosine = (away[1:-1] @ (away[2:] + away[:-2])) / (2 * away[1:-1] @ away[1:-1])
    assert np.arccos(cosine) / h == pytest.approx(2 / h * np.arctan(omega * h / 2), rel=1e-4)


@pytest.mark.parametrize("model", [ts.Springs("gaussian"), ts.Fem("neo-hookean")], ids=["gaussian", "fem"])
def test_a_very_long_step_is_the_static_solution(model: ts.Fem) -> None:
    still = cantilever(model, None, -2e-3).states[-1].displacement
    path = cantilever(model, ts.Dynamics(1e6, step=1e6, scheme="euler"), -2e-3)
    assert np.abs(path.states[-1].displacement - still).max() < 1e-7 * np.abs(still).max()


@LONG
def test_a_pendulum_of_ninety_degrees() -> None:
    """Period 4 sqrt(L / g) K(sin 45 deg); the spring's own stretch is below 1e-3."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0]])
    network = ts.SpringNetwork(nodes, np.array([[0, 1]]), np.array([1e5]), mass=np.ones(2))
    period = 4 / np.sqrt(G) * ellipk(0.5)
    errors = []
    for n in (200, 400):
        dynamics = ts.Dynamics(period, step=period / n, scheme="midpoint", record=period / n)
        loads = [ts.Force(on=[1], total=(0.0, -G))]
        problem = ts.Problem(network.mesh, supports=[ts.Fixed(on=[0])], loads=loads, dynamics=dynamics)
        path = ts.solve(problem, network, ts.Newton(tolerance=1e-10))
        angle = np.array([np.arctan2(state.positions[1, 1], state.positions[1, 0]) for state in path.states])
        turned = np.flatnonzero((angle[:-1] < -np.pi / 2) != (angle[1:] < -np.pi / 2))
        share = (-np.pi / 2 - angle[turned]) / (angle[turned + 1] - angle[turned])
        quarter, three = (turned + share)[:2] * period / n
        errors.append((three - quarter) * 2 / period - 1)
    assert 0 < errors[1] < errors[0] < 3e-3
    assert errors[1] < 1.2e-3


@pytest.mark.parametrize("scheme", ["midpoint", "bdf2", "leapfrog"])
def test_a_kelvin_voigt_oscillator(scheme: str) -> None:
    """Against the exponential of m x'' + tau k x' + k x = 0, with damping ratio 0.05; order 2."""
    omega, mass = 2.0, 1.0
    tau = 2 * 0.05 / omega
    period = 2 * np.pi / omega
    exact = expm(np.array([[0, 1], [-(omega**2), -tau * omega**2]]) * 2 * period) @ [0.0, 0.01]
    errors = []
    for n in (40, 80):
        dynamics = ts.Dynamics(
            2 * period,
            step=period / n,
            scheme=scheme,
            damping=ts.Damping(stiffness=tau),
            velocity=(0.01, 0.0),
            record=2 * period,
        )
        last = oscillator(dynamics, omega**2 * mass, mass).states[-1]
        errors.append(np.hypot(omega * (last.displacement[1, 0] - exact[0]), last.moving.velocity[1, 0] - exact[1]))
    assert errors[1] < 0.02 * 0.01
    assert np.log2(errors[0] / errors[1]) > (1.5 if scheme != "leapfrog" else 0.9)


def test_damping_by_the_surroundings() -> None:
    """v = v0 exp(-alpha t) of a free body; the energy that is lost is in `damped`."""
    dynamics = ts.Dynamics(
        0.5, step=1e-3, scheme="midpoint", damping=ts.Damping(mass=4.0), velocity=(1.0, 0.0), record=0.5
    )
    problem = ts.Problem(
        ts.rectangle((0.1, 0.1), (1, 1)), ts.Material(3e3, 0.3, density=1000.0), ts.PlaneStress(0.01), dynamics=dynamics
    )
    last = ts.solve(problem, ts.Fem("neo-hookean"), NEWTON).states[-1]
    assert last.moving.velocity[:, 0] == pytest.approx(np.exp(-2.0), rel=1e-5)
    kinetic = 0.1 / 2
    assert last.moving.energies.damped == pytest.approx(kinetic * (1 - np.exp(-4.0)), rel=1e-5)
    assert abs(last.moving.energies.numerical) < 1e-10 * kinetic


@pytest.mark.parametrize("model", [ts.Springs("gaussian"), ts.Fem("neo-hookean")], ids=["gaussian", "fem"])
@pytest.mark.parametrize("scheme", ORDERS)
def test_a_free_fall(scheme: str, model: ts.Fem) -> None:
    """Exact by midpoint, leapfrog and BDF2; g h t / 2 too far by Euler."""
    h, t = 2e-3, 0.1
    mesh = ts.rectangle((0.1, 0.05), (3, 2))
    problem = ts.Problem(
        mesh,
        ts.Material(3e3, 0.3, density=1000.0),
        ts.PlaneStress(0.01),
        loads=[ts.Gravity((0.0, -G))],
        dynamics=ts.Dynamics(t, step=h, scheme=scheme, velocity=(0.3, 0.0), record=t),
    )
    last = ts.solve(problem, model, NEWTON).states[-1]
    fallen = G * t**2 / 2 + (G * h * t / 2 if scheme == "euler" else 0.0)
    assert last.displacement[:, 1] == pytest.approx(-fallen, rel=1e-9)
    assert last.displacement[:, 0] == pytest.approx(0.3 * t, rel=1e-9)
    assert last.moving.velocity[:, 1] == pytest.approx(-G * t, rel=1e-9)
    assert problem.mass.sum() == pytest.approx(1000 * 0.1 * 0.05 * 0.01, rel=1e-14)


@pytest.mark.parametrize("model", [ts.Springs("gaussian"), pytest.param(ts.Fem("neo-hookean"), marks=LONG)])
def test_longitudinal_vibration_of_a_bar(model: ts.Fem) -> None:
    """Frequency c / 4 L of a bar fixed at one end whose width is free, and the arrival of a front at L / c."""
    length, n, young, density = 0.4, 40, 1e4, 1000.0
    c = np.sqrt(young / density)
    mesh = ts.rectangle((length, length / n), (n, 1))
    supports = [ts.Fixed("left", ["x"]), ts.Fixed("left-bottom", ["y"])]
    period = 4 * length / c

    def moved(duration: float, velocity: tuple[float, float] | None, load: float) -> ts.Solution:
        dynamics = ts.Dynamics(duration, scheme="leapfrog", record=duration / 400, velocity=velocity)
        loads = [ts.Force("right", (load, 0.0))] if load else []
        material = ts.Material(young, 0.3, density=density)
        problem = ts.Problem(mesh, material, ts.PlaneStress(0.01), supports, loads, dynamics=dynamics)
        return ts.solve(problem, model, NEWTON)

    # Let go at a small uniform velocity, the end follows a triangle of period 4 L / c.
    path = moved(2.2 * period, (1e-5, 0.0), 0.0)
    end = np.array([state.displacement[n, 0] for state in path.states])
    times = np.array([state.moving.time for state in path.states])
    turned = np.flatnonzero(end[1:-1] * end[2:] < 0) + 1
    crossed = times[turned] + end[turned] / (end[turned] - end[turned + 1]) * (times[turned + 1] - times[turned])
    assert len(crossed) == 4
    assert 2 * np.diff(crossed).mean() == pytest.approx(period, rel=5e-3)
    # A pull at the free end: the fixed end feels it L / c later, within the time of two elements.
    path = moved(1.5 * length / c, None, 1e-5)
    reaction = np.array([-state.reaction[:, 0].sum() for state in path.states])
    times = np.array([state.moving.time for state in path.states])
    arrived = float(np.interp(1e-5, reaction[: int(reaction.argmax()) + 1], times[: int(reaction.argmax()) + 1]))
    assert arrived == pytest.approx(length / c, abs=2 * length / n / c)


def test_runs_repeat_bit_for_bit() -> None:
    dynamics = ts.Dynamics(0.05, step=5e-3, scheme="bdf2", damping=ts.Damping(2e-3))
    one, other = (cantilever(ts.Springs("gaussian"), dynamics, -2e-3) for _ in range(2))
    assert all((a.positions == b.positions).all() for a, b in zip(one.states, other.states, strict=True))


@LONG
def test_an_automatic_step_keeps_its_accuracy() -> None:
    model = ts.Springs("gaussian")
    truth = cantilever(model, ts.Dynamics(0.2, step=2e-4, scheme="midpoint", record=0.02), -2e-3)
    errors = []
    for accuracy in (1e-3, 1e-4):
        path = cantilever(model, ts.Dynamics(0.2, scheme="bdf2", record=0.02, accuracy=accuracy), -2e-3)
        away = [np.abs(a.positions - b.positions).max() for a, b in zip(path.states, truth.states, strict=True)]
        errors.append(max(away) / max(np.abs(state.displacement).max() for state in truth.states))
    assert errors[1] < errors[0] / 2 and errors[0] < 0.03 and errors[1] < 6e-3


def test_auto_chooses_by_the_stable_step_and_says_so() -> None:
    soft = cantilever(ts.Fem("neo-hookean"), ts.Dynamics(0.1, step=5e-3))
    assert soft.cost is not None and soft.cost.newton.startswith("leapfrog")
    assert any("largest stable step" in note for note in soft.cost.notes)
    slow = cantilever(ts.Fem("neo-hookean"), ts.Dynamics(20.0, step=1.0))
    assert slow.cost is not None and slow.cost.newton.startswith("bdf2")
    assert any("explicit steps" in note for note in slow.cost.notes)


def test_a_fixed_number_of_iterations_says_so() -> None:
    dynamics = ts.Dynamics(0.2, step=1e-2, scheme="bdf2", iterations=1)
    path = cantilever(ts.Springs("gaussian"), dynamics, -2e-3)
    assert path.status is ts.Status.FIXED_ITERATIONS and path.complete
    assert path.newton_iterations == 20
    assert any("1 iteration a step, not converged" in warning for warning in path.warnings)


def test_the_motion_begins_at_the_equilibrium_of_time_zero() -> None:
    """Under its weight, a body that begins in equilibrium does not move."""
    problem = ts.Problem(
        ts.rectangle((0.16, 0.04), (8, 2)),
        ts.Material(3e3, 0.3, density=1000.0),
        ts.PlaneStress(0.01),
        [ts.Fixed("left")],
        [ts.Gravity((0.0, -1.0))],
        dynamics=ts.Dynamics(0.1, step=5e-3, scheme="bdf2", start="equilibrium"),
    )
    path = ts.solve(problem, ts.Springs("gaussian"), ts.Newton(tolerance=1e-11))
    first = path.states[0].displacement
    still = ts.solve(replace(problem, dynamics=None), ts.Springs("gaussian"), ts.Newton(tolerance=1e-11))
    assert first == pytest.approx(still.states[-1].displacement, rel=1e-9)
    assert np.abs(path.states[-1].displacement - first).max() < 1e-8 * np.abs(first).max()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"duration": -1.0}, "duration = -1.0 s: must be a positive number"),
        ({"step": -1e-3}, 'must be a positive number, or "auto"'),
        ({"step": 2.0}, "longer than duration"),
        ({"scheme": "bdf3"}, "did you mean 'bdf2'"),
        ({"start": "equilibrum"}, "equilibrium"),
        ({"iterations": 2}, "iterations needs a step"),
        ({"iterations": -1, "step": 1e-3}, "must be 0"),
        ({"velocity": (1.0,)}, "velocity"),
        ({"scheme": "leapfrog", "step": 0.05}, "not stable with leapfrog"),
        ({"scheme": "leapfrog", "step": 1e-4, "iterations": 1}, "no iterations"),
        ({"damping": 0.1}, "damping = 0.1: must be Damping("),
        ({"accuracy": "x"}, "accuracy = 'x'"),
        ({"substeps": 0}, "substeps = 0"),
        ({"iterations": True, "step": 1e-3}, "iterations = True"),
    ],
)
def test_bad_input(change: dict, says: str) -> None:
    with pytest.raises(TruespringError) as raised:
        cantilever(ts.Fem("neo-hookean"), ts.Dynamics(**{"duration": 0.1, **change}))
    assert says in str(raised.value)


def test_a_support_that_moves_needs_a_history() -> None:
    with pytest.raises(TruespringError, match="would jump at time 0: give its history, such as over"):
        strip(ts.Dynamics(0.1), supports=[ts.Fixed("left", displacement=(1e-3, 0.0))])


def test_a_motion_needs_a_density_and_newton() -> None:
    known = {"mesh": ts.rectangle((1.0, 1.0), (1, 1)), "section": ts.PlaneStress(0.1), "dynamics": ts.Dynamics(1.0)}
    with pytest.raises(TruespringError, match="a motion needs a density"):
        ts.Problem(material=ts.Material(1e3, 0.3), **known)
    problem = ts.Problem(material=ts.Material(1e3, 0.3, density=1e3), **known)
    with pytest.raises(TruespringError, match="Newton's method, not by ArcLength"):
        ts.solve(problem, ts.Fem("linear"), ts.ArcLength())


def test_a_step_that_fails_keeps_what_was_reached() -> None:
    """A load that St. Venant-Kirchhoff elements cannot bear in compression: the states before remain."""
    dynamics = ts.Dynamics(0.1, step=2e-3, scheme="bdf2", record=2e-3)
    path = cantilever(ts.Fem("neo-hookean"), dynamics, -2e-3, max_iterations=1)
    assert path.status is ts.Status.NOT_CONVERGED and path.states[0].load_factor == 0.0
    assert any("the step from time" in warning and "shorter step" in warning for warning in path.warnings)


def strip(dynamics: ts.Dynamics | None, model: object | None = None, **further: object) -> ts.Solution:
    """A small cantilever, by default with springs."""
    known = {
        "mesh": ts.rectangle((0.04, 0.02), (4, 2)),
        "material": ts.Material(1e4, 0.3, density=1000.0),
        "section": ts.PlaneStress(0.01),
        "supports": [ts.Fixed("left")],
        "dynamics": dynamics,
    }
    return ts.solve(ts.Problem(**{**known, **further}), model or ts.Springs("gaussian"), ts.Newton(tolerance=1e-9))


@LONG
def test_an_automatic_step_follows_a_load_that_grows_from_zero_later() -> None:
    pull = [ts.Force("right", (0.0, -0.02), over=[(0.0, 0), (0.02, 0), (0.06, 1)])]
    truth = strip(ts.Dynamics(0.1, scheme="leapfrog", step=2e-4, record=0.02), loads=pull)
    path = strip(ts.Dynamics(0.1, scheme="bdf2", record=0.02), loads=pull)
    assert path.complete, path.warnings
    away = [np.abs(a.displacement - b.displacement).max() for a, b in zip(path.states, truth.states, strict=True)]
    assert max(away) < 0.01 * np.abs(truth.states[-1].displacement).max()


@pytest.mark.parametrize("model", [ts.Springs("isotropic"), ts.Fem("saint-venant-kirchhoff"), ts.Fem("linear")])
def test_a_body_that_rests_at_first_is_not_unstable(model: ts.Fem) -> None:
    pull = [ts.Force("right", (0.0, -0.02), over=[(0.0, 0), (0.05, 0), (0.1, 1)])]
    path = strip(ts.Dynamics(0.1, step=2e-3, scheme="bdf2", record=0.02), model, loads=pull)
    assert path.status is ts.Status.CONVERGED, path.warnings


def test_a_pulse_shorter_than_the_step_is_not_missed() -> None:
    """Steps end at the corners of histories; the momentum of the pulse is force times duration."""
    pulse = [(0.0, 0), (0.051, 0), (0.052, 1), (0.054, 1), (0.055, 0)]
    loads = [ts.Force("right", (0.0, -0.1), over=pulse)]
    path = strip(ts.Dynamics(0.06, step=0.01, scheme="midpoint"), loads=loads, supports=())
    momentum = (path.problem.mass[:, None] * path.states[-1].moving.velocity).sum(axis=0)
    assert momentum == pytest.approx([0.0, -0.1 * 0.003], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("scheme", [pytest.param(one, marks=[] if one == "leapfrog" else LONG) for one in ORDERS])
def test_a_support_that_stops_comes_to_rest(scheme: str) -> None:
    """Held nodes have the velocity of their support, and it carries what their inertia and damping need."""
    moved = [ts.Fixed("left", displacement=(4e-3, 0.0), over=[(0.0, 0), (0.05, 1)])]
    damping = ts.Damping(stiffness=5e-3, mass=10.0)
    path = strip(ts.Dynamics(0.2, step=8e-4, scheme=scheme, damping=damping, record=0.05), supports=moved)
    left = path.problem.mesh.nodes[:, 0] == 0
    assert path.states[-1].moving.velocity[left] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(path.states[-1].reaction).max() < 2e-3 * np.abs(path.states[0].reaction).max() + 1e-4
    kept = [state.moving.energies for state in path.states]
    done = max(abs(one.loads) for one in kept)
    assert max(abs(one.numerical) for one in kept) < (0.05 if scheme in ("midpoint", "leapfrog") else 0.5) * done


def test_drag_on_a_moved_support() -> None:
    """A body moved as a whole at 0.1 m/s against alpha M v: the supports carry it, for all schemes."""
    moved = [ts.Fixed(range(15), displacement=(0.01, 0.0), over=[(0.0, 0), (0.1, 1)])]
    for scheme in ORDERS:
        asked = ts.Dynamics(0.1, step=1e-3, scheme=scheme, damping=ts.Damping(mass=10.0), record=0.05)
        path = strip(asked, supports=moved)
        force = path.states[1].reaction[:, 0].sum()
        assert force == pytest.approx(10.0 * path.problem.mass.sum() * 0.1, rel=1e-9), scheme
        assert abs(path.states[1].moving.energies.numerical) < 1e-12


def test_a_free_fall_of_second_order_elements() -> None:
    mesh = ts.rectangle((0.04, 0.02), (2, 1), element="triangle")
    for model in (ts.Fem("neo-hookean", element="quadratic"), ts.Springs("gaussian", element="quadratic")):
        asked = ts.Dynamics(0.04, step=4e-3, scheme="midpoint")
        last = strip(asked, model, mesh=mesh, supports=(), loads=[ts.Gravity((0.0, -G))]).states[-1]
        assert last.moving.velocity[:, 1] == pytest.approx(-G * 0.04, rel=1e-9)


def test_the_equilibrium_at_time_zero_has_the_grasps_of_time_zero() -> None:
    """Nothing moves under gravity while a grasp rests."""
    hold = ts.Grasp("hand", (0.04, 0.01), 0.011, [(0.0, 0.04, 0.01), (0.1, 0.04, 0.01)])
    asked = ts.Dynamics(0.1, step=5e-3, scheme="bdf2", start="equilibrium")
    path = strip(asked, loads=[ts.Gravity((0.0, -G))], grasps=[hold])
    sagged = np.abs(path.states[0].displacement).max()
    assert path.states[0].touches[0].force[1] < -1e-3
    moved = max(np.abs(state.displacement - path.states[0].displacement).max() for state in path.states)
    assert moved < 1e-6 * sagged


def test_a_free_body_has_no_equilibrium_to_begin_with() -> None:
    asked = ts.Dynamics(0.1, step=5e-3, scheme="bdf2", start="equilibrium")
    path = strip(asked, supports=(), loads=[ts.Gravity((0.0, -G))])
    assert path.status is ts.Status.NOT_CONVERGED
    assert any("equilibrium at time 0 was not found: add supports" in warning for warning in path.warnings)


def test_few_iterations_with_contact_stay_near_the_solved_motion() -> None:
    press = [(0.0, 0.03, 0.035), (0.05, 0.03, 0.027)]
    tool = ts.Sphere("probe", 0.01, press, stiffness=1e7)

    def force(iterations: int) -> float:
        asked = ts.Dynamics(0.05, step=2.5e-3, scheme="bdf2", iterations=iterations)
        path = strip(asked, ts.Fem("neo-hookean"), supports=[ts.Fixed("bottom")], tools=[tool])
        assert path.complete, path.warnings
        return float(path.states[-1].touches[0].force[1])

    assert force(0) > 1e-2
    assert force(3) == pytest.approx(force(0), rel=0.02)


def test_auto_counts_dashpots_and_contacts() -> None:
    stiff = ts.HalfSpace("wall", (0.0, 1.0), [(0.0, 0.0, -0.01), (0.1, 0.0, -0.01)], stiffness=1e12)
    plain = strip(ts.Dynamics(0.1, step=5e-3), loads=[ts.Force("right", (0.0, -0.01))])
    damped = strip(ts.Dynamics(0.1, step=5e-3, damping=ts.Damping(0.2)), loads=[ts.Force("right", (0.0, -0.01))])
    walled = strip(ts.Dynamics(0.1, step=5e-3), loads=[ts.Force("right", (0.0, -0.01))], tools=[stiff])
    chosen = [path.cost.newton.split(",")[0] for path in (plain, damped, walled)]
    assert chosen == ["leapfrog", "bdf2", "bdf2"]


def test_leapfrog_keeps_to_a_time_limit() -> None:
    problem = strip(ts.Dynamics(0.01, step=1e-3), loads=[ts.Force("right", (0.0, -0.01))]).problem
    endless = replace(problem, dynamics=ts.Dynamics(2.0, step=1e-5, scheme="leapfrog"))
    path = ts.solve(endless, ts.Springs("gaussian"), timeout=0.3)
    assert path.status is ts.Status.NOT_CONVERGED and any("time limit" in warning for warning in path.warnings)
