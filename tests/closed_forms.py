"""Answers that stand on their own: closed forms, elliptic integrals and small root findings, no truespring."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize, root
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

import truespring as ts
from truespring.models import LAWS, Law
from truespring.models.law import Constants

Floats = NDArray[np.float64]


# --- The lattice of rectangles with an edge and a diagonal stiffness --------------------------------------------------


def lattice_tension(
    force: float, sides: tuple[float, float], edges: tuple[float, float], diagonal: float, kappa: float = 0.0
) -> tuple[float, float]:
    """Return the stretches along x and y of a cell pulled along x and free across.

    `force` [N] acts on each side of the cell of `sides` [m]; it has two edges of each direction of
    stiffness `edges` [N/m], two diagonals of `diagonal`, and by its area A an energy kappa/2 A_0 (A/A_0 - 1)^2,
    `kappa` [N/m]: exact for any block of such cells.
    """
    (a, b), (k_x, k_y) = sides, edges
    rest = math.hypot(a, b)

    def shortening(stretch: float, across: float) -> float:
        return 1 - rest / math.hypot(a * stretch, b * across)

    def across_of(stretch: float) -> float:
        def lateral(across: float) -> float:
            pressure = kappa * (stretch * across - 1)
            return k_y * (across - 1) + diagonal * shortening(stretch, across) * across + pressure * stretch * a / b / 2

        return float(brentq(lateral, 0.3, 1.7, xtol=1e-15, rtol=1e-15))

    def out_of_balance(stretch: float) -> float:
        across = across_of(stretch)
        diagonals = diagonal * shortening(stretch, across) * stretch
        return 2 * a * (k_x * (stretch - 1) + diagonals) + kappa * b * (stretch * across - 1) * across - force

    stretch = float(brentq(out_of_balance, 0.7, 2.5, xtol=1e-15, rtol=1e-15))
    return stretch, across_of(stretch)


def cube_tension(stress: float, links: tuple[float, float, float], kappa: float) -> tuple[float, float]:
    """Return the stretches along and across of a unit cube of springs pulled by a nominal stress [Pa].

    It has twelve edges, twelve diagonals of faces and four through the body, of stiffness `links` [N/m] each, its
    share of a block; and by its volume V an energy kappa/2 (V - 1)^2.
    """
    edge, face, body = links

    def out_of_balance(stretches: Floats) -> Floats:
        x, y = stretches  # y is the stretch of both directions across
        tilted, space = math.hypot(x, y), math.sqrt(x * x + 2 * y * y)
        pressure = kappa * (x * y * y - 1)
        tilted_pull = 8 * face * (1 - math.sqrt(2) / tilted)
        space_pull = 4 * body * (1 - math.sqrt(3) / space)
        along = 4 * edge * (x - 1) + (tilted_pull + space_pull) * x + pressure * y * y
        flat_pull = 8 * face * (1 - 1 / y)
        across = 8 * edge * (y - 1) + (tilted_pull + 2 * space_pull + flat_pull) * y + 2 * pressure * x * y
        return np.array([along - stress, across])

    found = root(out_of_balance, [1.0, 1.0], tol=1e-15)
    assert np.abs(found.fun).max() < 1e-12 * (edge + face + body)
    return float(found.x[0]), float(found.x[1])


def square_moduli(edge: float, diagonal: float) -> dict[str, float]:
    """Moduli of the square lattice over E; `edge` and `diagonal` [t E] of each element, summed.

    From C11 = 2 a + b and C12 = C66 = b, the lattice sum of Brisard, "What is homogenization?", part 4.
    """
    a, b = edge, diagonal
    return {
        "young_0": 4 * a * (a + b) / (2 * a + b),
        "poisson_0": b / (2 * a + b),
        "young_45": 4 * b * (a + b) / (a + 2 * b),
        "poisson_45": a / (a + 2 * b),
        "zener": b / a,
    }


def bending_factor(edge: float, diagonal: float, depth: int, single: bool = False) -> float:
    """EI over E t H^3 / 12 of a strip of square cells, `depth` of them over its height.

    Bent to curvature 1 the edges at height y stretch by y, whole rows contract freely across:
    EI = sum over levels k y^2 + sum over rows c b / (c + b) y^2, uprights c and diagonals b of a cell in series.
    """
    levels = np.arange(depth + 1) - depth / 2
    middles = levels[:-1] + 0.5
    shared = np.full(depth + 1, edge if single else 2 * edge)
    shared[[0, -1]] = edge
    upright = edge if single else 2 * edge
    row = upright * diagonal / (upright + diagonal)
    return float(((shared * levels**2).sum() + row * (middles**2).sum()) / (depth**3 / 12))


# --- Any lattice of springs, on its periodic cell --------------------------------------------------------------------

#: Components of a strain in Voigt's order, by dimension.
VOIGT = {2: ((0, 0), (1, 1), (0, 1)), 3: ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))}


def periodic_elasticity(ends: Floats, stiffness: Floats, cell: Floats) -> Floats:
    """Return the elasticity [Pa] (2D: [N/m]) of an unbounded lattice in Voigt's order, its nodes relaxed.

    `ends` [m], shape (n_springs, 2, dim), and `stiffness` [N/m] of the springs of one cell; `cell` has the
    lattice vectors [m] as rows. Ends that differ by lattice vectors are one node, moved by A e, e a uniform
    strain, plus what makes the energy least.
    """
    dim = ends.shape[2]
    inside = np.round(np.mod(ends @ np.linalg.inv(cell) + 1e-7, 1.0), 5)
    _, node = np.unique(inside.reshape(-1, dim), axis=0, return_inverse=True)
    node = node.reshape(-1, 2)
    across = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(across, axis=1)
    unit = across / length[:, None]
    every = np.arange(len(ends))
    by_node = np.zeros((len(ends), node.max() + 1, dim))
    np.add.at(by_node, (every, node[:, 1]), unit)
    np.add.at(by_node, (every, node[:, 0]), -unit)
    by_node = by_node.reshape(len(ends), -1)
    by_strain = np.stack([length * unit[:, i] * unit[:, j] for i, j in VOIGT[dim]], axis=1)
    K, coupling = by_node.T @ (stiffness[:, None] * by_node), by_node.T @ (stiffness[:, None] * by_strain)
    settled = -np.linalg.pinv(K, rcond=1e-10, hermitian=True) @ coupling
    assert np.abs(K @ settled + coupling).max() < 1e-12 * np.abs(stiffness).max() * length.max(), "not in balance"
    change = by_strain + by_node @ settled
    return np.asarray(change.T @ (stiffness[:, None] * change) / abs(np.linalg.det(cell)))


def tensile_test(elasticity: Floats, along: Sequence[float]) -> tuple[float, float]:
    """Young's modulus and Poisson's ratio, the mean over all directions across, of a test along a vector."""
    n = np.asarray(along, dtype=float) / np.linalg.norm(along)
    dim = len(n)
    found = np.linalg.solve(elasticity, [n[i] * n[j] for i, j in VOIGT[dim]])
    strain = np.zeros((dim, dim))
    for (i, j), component in zip(VOIGT[dim], found, strict=True):
        strain[i, j] = strain[j, i] = component if i == j else component / 2
    axial = float(n @ strain @ n)
    return 1 / axial, -(float(np.trace(strain)) - axial) / (dim - 1) / axial


def young_extremes(elasticity: Floats) -> tuple[float, float]:
    """Smallest and largest Young's modulus in space: a grid over half the sphere, its best points refined."""
    compliance = np.linalg.inv(elasticity)

    def young(angles: Floats) -> Floats:
        polar, turn = angles[..., 0], angles[..., 1]
        n = (np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar))
        stress = np.stack([n[i] * n[j] for i, j in VOIGT[3]], axis=-1)
        return np.asarray(1 / ((stress @ compliance) * stress).sum(axis=-1))

    grid = np.stack(np.meshgrid(np.linspace(0.01, 1.57, 60), np.arange(0, 6.28, 0.03)), axis=-1).reshape(-1, 2)
    found = young(grid)

    def best(sign: float) -> float:
        starts = grid[np.argsort(sign * found)[[0, 1, 5]]]
        options = {"xatol": 1e-9, "fatol": 1e-13}
        return min(
            minimize(lambda a: sign * float(young(a)), start, method="Nelder-Mead", options=options).fun
            for start in starts
        )

    return float(best(1.0)), float(-best(-1.0))


# --- Beams -----------------------------------------------------------------------------------------------------------


def elastica_tip(alpha: float) -> tuple[float, float, float]:
    """Slope, deflection and shortening, by length, of a cantilever under a dead end load P = alpha EI / L^2.

    Bisshopp and Drucker, Quarterly of Applied Mathematics 3 (1945) 272-275: sqrt(alpha) = K(p) - F(phi, p)
    with sin(phi) = 1 / (p sqrt 2), the slope from sin(slope) = 2 p^2 - 1.
    """

    def amplitude(p: float) -> float:
        return math.asin(min(1.0, 1 / (p * math.sqrt(2))))

    def excess(p: float) -> float:
        return float(ellipk(p * p) - ellipkinc(amplitude(p), p * p)) - math.sqrt(alpha)

    p = float(brentq(excess, math.sqrt(0.5), 1 - 1e-14, xtol=1e-16, rtol=1e-15))
    deflection = 1 - 2 / math.sqrt(alpha) * float(ellipe(p * p) - ellipeinc(amplitude(p), p * p))
    slope = math.asin(2 * p * p - 1)
    return slope, deflection, 1 - math.sqrt(2 * math.sin(slope) / alpha)


def buckled_column_tip(overload: float) -> tuple[float, float]:
    """Sideways and downward motion, by length, of a clamped-free column under `overload` times Euler's load.

    Euler's elastica: P L^2 / EI = K(p)^2, sideways 2 p / K, downward 2 - 2 E / K.
    """
    p = float(brentq(lambda p: float(ellipk(p * p)) - math.pi / 2 * math.sqrt(overload), 1e-9, 1 - 1e-12))
    K, E = float(ellipk(p * p)), float(ellipe(p * p))
    return 2 * p / K, 2 - 2 * E / K


# --- Trusses ---------------------------------------------------------------------------------------------------------


def shallow_truss_force(sunk: float, half_span: float, rise: float, stiffness: float) -> float:
    """Force on the top of two bars that lean on each other, sunk by `sunk` [m]: 2 k (L0 - l) sin(slope) [N]."""
    rest, height = math.hypot(half_span, rise), rise - sunk
    length = math.hypot(half_span, height)
    return 2 * stiffness * (rest - length) * height / length


def shallow_truss_limit(half_span: float, rise: float, stiffness: float) -> tuple[float, float]:
    """Where it snaps: the motion [m] and the largest force [N], 2 k L0 (1 - (c/L0)^(2/3))^(3/2)."""
    rest = math.hypot(half_span, rise)
    ratio = (half_span / rest) ** (2 / 3)
    sunk = rise - math.sqrt((rest * half_span**2) ** (2 / 3) - half_span**2)
    return sunk, 2 * stiffness * rest * (1 - ratio) ** 1.5


# --- Constitutive laws in principal stretches ------------------------------------------------------------------------


def material_of(law: str, young: float, poisson: float) -> ts.Material:
    """A material for a law, with examples of the constants that it takes, those that are stresses by `young` / 3 Pa.

    Of a law whose constants give the moduli at small strain they are scaled to `young`, and Poisson's ratio is that of
    the examples.
    """
    entry = LAWS[law]
    values = {name: constant.example for name, constant in entry.constants.items()}
    scale = young / 3.0
    if entry.lame is not None:
        lam, mu = entry.lame(values)
        scale, poisson = young * (lam + mu) / mu / (3 * lam + 2 * mu), lam / 2 / (lam + mu)
    scaled = {name: value * (scale if entry.constants[name].dimension else 1.0) for name, value in values.items()}
    return ts.Material(young, poisson, constants=scaled)


def nominal_stress(law: Law, constants: Constants, stretch: Floats) -> Floats:
    """Derivative of a law's own closed form by the stretches [Pa], shape (3,): by a complex step, so to rounding."""
    steps = 1e-30j * np.eye(3)
    return np.array([np.imag(law.density(stretch + step, constants)) / 1e-30 for step in steps])


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Lame's constants [Pa]."""
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))


def principal_state(
    law: str, young: float, poisson: float, given: Sequence[float | None], free_guess: float = 1.0
) -> tuple[Floats, Floats]:
    """Return three stretches and nominal stresses [Pa] of `material_of`; None in `given` is a direction without stress.

    A list of `given` is that of a body in 3D or in plane strain; plane stress is one with None as the last.
    """
    unit = material_of(law, 1.0, poisson)
    constants = Constants(*lame(1.0, unit.poisson), False, dict(unit.constants))
    stretch = np.array([np.nan if one is None else one for one in given])
    free = np.isnan(stretch)

    def stress(unknown: Floats) -> Floats:
        stretch[free] = unknown
        return nominal_stress(LAWS[law], constants, stretch)

    if free.any():
        found = root(lambda unknown: stress(unknown)[free], np.full(int(free.sum()), free_guess), tol=1e-14)
        assert np.abs(found.fun).max() < 1e-12, f"no free stretch found for {law} at {given}"
        return stretch, young * stress(found.x)
    return stretch, young * stress(np.zeros(0))


# --- Derivatives -----------------------------------------------------------------------------------------------------


def difference_errors(function: Callable[[float], Floats], derivative: Floats, steps: Sequence[float]) -> Floats:
    """Size of central difference less `derivative` over size of `derivative`, for each step, shape (steps,)."""
    size = float(np.linalg.norm(derivative))
    assert size > 0, "a derivative that vanishes proves nothing"
    differences = [(function(step) - function(-step)) / (2 * step) for step in steps]
    return np.array([np.linalg.norm(difference - derivative) / size for difference in differences])


def observed_orders(errors: Floats, steps: Sequence[float]) -> Floats:
    """Slopes of the errors against the steps in logarithms, shape (steps - 1,)."""
    return np.asarray(np.diff(np.log(errors)) / np.diff(np.log(np.array(steps))))


# --- A pipe under pressure that follows, neo-Hookean, in plane strain -------------------------------------------------


def pressed_pipe(pressure: float, young: float, poisson: float, inner: float, outer: float) -> tuple[float, float]:
    """Return the radius inside and the stored energy of a whole pipe [J/m], pressed from inside, free outside.

    The only equation is along the radius, dP/dR + (P - Q) / R = 0 with P and Q the nominal stress along and around, of
    W = mu/2 (tr C - 3) - mu ln J + lam/2 (ln J)^2. It is integrated from the radius inside, where P is -p times the
    stretch around, and that radius is the one that leaves the outside free.
    """
    lam, mu = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)

    def along(radial: float, around: float) -> float:
        return mu * radial + (lam * math.log(radial * around) - mu) / radial

    def slope(place: float, values: Floats) -> list[float]:
        radius, stress, _ = values
        around = radius / place
        radial = float(brentq(lambda one: along(one, around) - stress, 0.05, 5.0, xtol=1e-15, rtol=1e-14))
        volume = math.log(radial * around)
        hoop = mu * around + (lam * volume - mu) / around
        density = mu / 2 * (radial**2 + around**2 - 2) - mu * volume + lam / 2 * volume**2
        return [radial, (hoop - stress) / place, 2 * math.pi * place * density]

    def outside(inside: float) -> Floats:
        start = [inside, -pressure * inside / inner, 0.0]
        found = solve_ivp(slope, (inner, outer), start, rtol=1e-10, atol=1e-12 * young)
        return np.asarray(found.y[:, -1])

    inside = float(brentq(lambda one: outside(one)[1], inner, 1.5 * inner, xtol=1e-12))
    return inside, float(outside(inside)[2])
