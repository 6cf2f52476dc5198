"""Energy and force of exported Gaussian springs, from the arrays alone by the formulas of docs/export/arrays.md."""

import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import truespring as ts
from truespring.arrays import Floats
from truespring.exports import Exported, solve_springs, target_files

_STRIP = ts.rectangle(size=(0.04, 0.02), elements=(4, 2))
_MIXED = ts.Mesh.of_kinds(
    np.array([[0.0, 0.0], [0.01, 0.0], [0.011, 0.01], [0.0, 0.01], [0.02, 0.004]]),
    {"quadrilateral": np.array([[0, 1, 2, 3]]), "triangle": np.array([[1, 4, 2]])},
)
_SHEET, _SLICE = ts.PlaneStress(0.01), ts.PlaneStrain(0.01)
_STIFF = ts.Material(20e3, 0.4, constants={"jm": 20.0})
_FIBRES = ts.Fibres([(1.0, 0.5), (0.0, 1.0)], 5e3, 2.0)

#: Mesh, section and parameters of the rule.
BODIES: dict[str, tuple[ts.Mesh, Any, dict[str, Any]]] = {
    "cubes": (ts.box(size=(0.04, 0.02, 0.02), elements=(2, 1, 1)), None, {}),
    "plane strain": (_STRIP, _SLICE, {}),
    "plane stress": (_STRIP, _SHEET, {"hourglass": 1.3}),
    "mixed": (_MIXED, _SHEET, {}),
    "gent": (_MIXED, _SLICE, {"law": "gent"}),
    "fibres": (_STRIP, _SHEET, {}),
    "ten nodes": (ts.box((0.02, 0.01, 0.01), (1, 1, 1), element="tetrahedron"), None, {"element": "quadratic"}),
    "six nodes": (ts.rectangle((0.02, 0.01), (2, 1), element="triangle"), _SHEET, {"element": "quadratic"}),
    "six nodes, fibres": (ts.rectangle((0.02, 0.01), (2, 1), element="triangle"), _SLICE, {"element": "quadratic"}),
}


def solved(body: str) -> Exported:
    mesh, section, rule = BODIES[body]
    problem = ts.Problem(
        mesh,
        ts.Material(10e3, 0.3, constants={"jm": 30.0}, fibres=_FIBRES if "fibres" in body else None),
        section,
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.02, 0.03, 0.01)[: mesh.dim])],
        regions=[ts.Region(ts.Box((0.01, -1.0, -1.0)[: mesh.dim], (1.0,) * mesh.dim), _STIFF)],
    )
    return solve_springs(problem, ts.Springs("gaussian", **rule), ts.Newton(load_steps=1))


def npz(one: Exported) -> dict[str, Any]:
    (content,) = target_files(one, ["npz"])["npz"].values()
    assert isinstance(content, bytes)
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def as_json(one: Exported) -> dict[str, Any]:
    (content,) = target_files(one, ["json"])["json"].values()
    return {name: np.asarray(value) for name, value in json.loads(content).items() if name != "units"}


def by_hand(values: Mapping[str, Any], x: Floats) -> tuple[float, Floats]:
    """Return energy [J] and internal force [N] at the positions x of all nodes [m]."""
    energy, force = 0.0, np.zeros_like(x)
    if values["law"] == "neo-hookean":  # springs of constant stiffness
        first, second = values["springs"].T
        pull = values["stiffness"][:, None] * (x[second] - x[first])
        energy += ((x[second] - x[first]) * pull).sum() / 2
        np.add.at(force, first, -pull)
        np.add.at(force, second, pull)
    for kind in {name.removeprefix("mu") for name in values if name == "mu" or name.startswith("mu_")}:
        own = {name.removesuffix(kind): value for name, value in values.items() if name.endswith(kind)}
        energy += (points if "gradients" in own else elements)(own | {"law": values["law"]}, values, x, force)
    return energy, force


def elements(own: Mapping[str, Any], values: Mapping[str, Any], x: Floats, force: Floats) -> float:
    """Add the forces of the elements of one kind, and return their energy."""
    nodes = own.get("corners", values["elements"])
    simplices = nodes[:, own["simplices"]]
    edges = np.diff(x[simplices][:, :, [[0, k] for k in range(1, simplices.shape[2])]], axis=3)[:, :, :, 0]
    scale = own["simplex_weight"] * values["thickness"] / [1, 1, 2, 6][x.shape[1]]
    determinant = np.linalg.det(edges)
    slope = scale * determinant[:, :, None, None] * np.linalg.inv(edges).swapaxes(2, 3)
    V0, log = own["volume"], np.log(scale * determinant.sum(axis=1) / own["volume"])
    if own["law"] == "gent":
        ends = x[nodes[:, own["links"]]]
        across = ends[:, :, 1] - ends[:, :, 0]
        I1 = (own["link_weights"] * (across**2).sum(axis=2)).sum(axis=1) / V0 + (x.shape[1] == 2)
        bulk, shrunk = own["lam"] + 2 / 3 * own["mu"], np.exp(-2 / 3 * log)
        left = 1 - (I1 * shrunk - 3) / own["jm"]
        density = -own["mu"] * own["jm"] / 2 * np.log(left) + bulk / 2 * log**2
        pressure = bulk * log - own["mu"] / 3 * I1 * shrunk / left
        pull = (own["mu"] * shrunk / left)[:, None, None] * own["link_weights"][:, :, None] * across
        np.add.at(force, nodes[:, own["links"][:, 0]], -pull)
        np.add.at(force, nodes[:, own["links"][:, 1]], pull)
    else:
        density, pressure = volume_function(own, values, log, own["mu"], own["lam"])
    for weights in own.get("fibre_weights", ()):
        ends = x[nodes[:, own["links"]]]
        across = ends[:, :, 1] - ends[:, :, 0]
        of_fibres, slope_4 = fibre_energy((weights * (across**2).sum(axis=2)).sum(axis=1) / V0, own)
        density = density + of_fibres
        pull = 2 * slope_4[:, None, None] * weights[:, :, None] * across
        np.add.at(force, nodes[:, own["links"][:, 0]], -pull)
        np.add.at(force, nodes[:, own["links"][:, 1]], pull)
    pushes = (pressure / np.exp(log))[:, None, None, None] * slope
    np.add.at(force, simplices[:, :, 1:], pushes)
    np.add.at(force, simplices[:, :, 0], -pushes.sum(axis=2))
    return float((V0 * density).sum())


def fibre_energy(I4: Floats, own: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Return the energy density of fibres [J/m^3] and its derivative by the square of the stretch [Pa]."""
    k1, k2 = (own[name].reshape(-1, *[1] * (I4.ndim - 1)) for name in ("k1", "k2"))
    strain = np.maximum(I4 - 1, 0.0)
    safe = np.where(k2 > 0, k2, 1.0)
    return k1 / (2 * safe) * np.expm1(k2 * strain**2), k1 * strain * np.exp(k2 * strain**2)


def volume_function(own: Any, values: Any, log: Floats, mu: Floats, lam: Floats) -> tuple[Floats, Floats]:
    """Return g [J/m^3] and the Kirchhoff pressure [Pa] of the neo-Hookean law."""
    if values["section"] != "plane stress":
        missing = {"plane strain": -1.0, "": -1.5}[str(values["section"])]
        return missing * mu - mu * log + lam / 2 * log**2, lam * log - mu
    low, high = np.zeros_like(log), np.full_like(log, 100.0)  # of C33, by bisection
    for _ in range(200):
        C33 = (low + high) / 2
        above = mu * (C33 - 1) + lam * (log + np.log(C33) / 2) > 0
        low, high = np.where(above, low, C33), np.where(above, C33, high)
    log = log + np.log(C33) / 2
    return mu / 2 * (C33 - 3) - mu * log + lam / 2 * log**2, lam * log - mu


def points(own: Mapping[str, Any], values: Mapping[str, Any], x: Floats, force: Floats) -> float:
    """Add the forces of elements of second order, and return their energy."""
    nodes, gradients, volume = values["all_elements"], own["gradients"], own["point_volume"]
    F = np.einsum("eai,epaj->epij", x[nodes], gradients)
    J, inverse = np.linalg.det(F), np.linalg.inv(F)
    mu, lam = own["mu"][:, None], own["lam"][:, None]
    if values["section"] == "plane stress":
        density, pressure = volume_function(own, values, np.log(J), mu, lam)
        energy = (density * volume).sum()
    else:
        mean = (J * volume).sum(axis=1, keepdims=True) / volume.sum(axis=1, keepdims=True)
        missing = {"plane strain": -1.0, "": -1.5}[str(values["section"])]
        energy = ((missing * mu - mu * np.log(J) + lam / 2 * np.log(mean) ** 2) * volume).sum()
        pressure = lam * np.log(mean) * J / mean - mu
    np.add.at(force, nodes, np.einsum("ep,epji,epaj->eai", pressure * volume, inverse, gradients))
    for directions in own.get("fibre_directions", ()):
        along = np.einsum("epij,ej->epi", F, directions)
        density, slope = fibre_energy((along**2).sum(axis=2), own)
        energy += (density * volume).sum()
        parts = 2 * slope * volume, along, gradients, directions
        np.add.at(force, nodes, np.einsum("ep,epi,epaj,ej->eai", *parts))
    return float(energy)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("reader", [npz, as_json])
def test_arrays_alone_give_energy_and_force(body: str, reader: Any) -> None:
    one = solved(body)
    values, potential = reader(one), one.path.potential
    assert potential is not None
    nodes = values.get("all_nodes", values["nodes"])
    assert not values["rest_length"].any() and nodes.shape == potential.nodes.shape
    rng = np.random.default_rng(3)
    x = nodes @ (np.eye(nodes.shape[1]) + 0.3 * rng.random((nodes.shape[1],) * 2)) + 3e-4 * rng.random(nodes.shape)
    energy, force = by_hand(values, x)
    expected = potential.gradient(x)
    assert np.abs(force - expected).max() < 1e-12 * np.abs(expected).max() > 0
    assert energy == pytest.approx(potential.energy(x), rel=1e-11)


@pytest.mark.parametrize("body", ["cubes", "gent", "ten nodes", "six nodes"])
def test_exported_state_is_in_equilibrium_with_the_exported_loads(body: str) -> None:
    values = npz(solved(body))
    prefix = "all_" if "all_nodes" in values else ""
    energy, force = by_hand(values, values[f"{prefix}nodes"] + values[f"{prefix}displacement"])
    free, load = ~values[f"{prefix}held"], values[f"{prefix}external_force"]
    assert np.abs(force - load)[free].max() < 1e-7 * np.abs(load).max()
    assert energy == pytest.approx(float(values["energy"]), rel=1e-9)
    units = dict(line.split(": ") for line in values["units"].tolist())
    assert units.items() >= {f"{prefix}nodes": "m", f"{prefix}displacement": "m"}.items()
