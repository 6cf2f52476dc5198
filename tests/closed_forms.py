"""Answers that stand on their own: closed forms, elliptic integrals and small root findings, no truespring."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, root
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

Floats = NDArray[np.float64]


# --- The lattice of rectangles with an edge and a diagonal stiffness --------------------------------------------------


def lattice_tension(
    force: float, sides: tuple[float, float], edges: tuple[float, float], diagonal: float
) -> tuple[float, float]:
    """Return the stretches along x and y of a cell pulled along x and free across.

    `force` [N] acts on each side of the cell of `sides` [m]; it has two edges of each direction of
    stiffness `edges` [N/m] and two of `diagonal`: exact for any block of such cells.
    """
    (a, b), (k_x, k_y) = sides, edges
    rest = math.hypot(a, b)

    def shortening(stretch: float, across: float) -> float:
        return 1 - rest / math.hypot(a * stretch, b * across)

    def across_of(stretch: float) -> float:
        def lateral(across: float) -> float:
            return k_y * (across - 1) + diagonal * shortening(stretch, across) * across

        return float(brentq(lateral, 0.3, 1.7, xtol=1e-15, rtol=1e-15))

    def out_of_balance(stretch: float) -> float:
        diagonals = diagonal * shortening(stretch, across_of(stretch)) * stretch
        return 2 * a * (k_x * (stretch - 1) + diagonals) - force

    stretch = float(brentq(out_of_balance, 0.7, 2.5, xtol=1e-15, rtol=1e-15))
    return stretch, across_of(stretch)


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


def _linear(stretch: Floats, lam: float, mu: float) -> Floats:
    strain = stretch - 1
    return lam * strain.sum() + 2 * mu * strain


def _saint_venant_kirchhoff(stretch: Floats, lam: float, mu: float) -> Floats:
    strain = (stretch**2 - 1) / 2
    return stretch * (lam * strain.sum() + 2 * mu * strain)


def _neo_hookean(stretch: Floats, lam: float, mu: float) -> Floats:
    return mu * (stretch - 1 / stretch) + lam * np.log(stretch).sum() / stretch


def _hencky(stretch: Floats, lam: float, mu: float) -> Floats:
    strain = np.log(stretch)
    return (lam * strain.sum() + 2 * mu * strain) / stretch


#: Nominal stresses dW/dl_i [Pa] of the principal stretches l, shape (3,), by Lame's constants [Pa].
NOMINAL_STRESS: dict[str, Callable[[Floats, float, float], Floats]] = {
    "linear": _linear,
    "saint-venant-kirchhoff": _saint_venant_kirchhoff,
    "neo-hookean": _neo_hookean,
    "hencky": _hencky,
}


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Lame's constants [Pa]."""
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))


def principal_state(
    law: str, young: float, poisson: float, given: Sequence[float | None], free_guess: float = 1.0
) -> tuple[Floats, Floats]:
    """Return the three stretches and nominal stresses [Pa]; None in `given` is a direction free of stress."""
    lam, mu = lame(1.0, poisson)
    stretch = np.array([np.nan if one is None else one for one in given])
    free = np.isnan(stretch)

    def stress(unknown: Floats) -> Floats:
        stretch[free] = unknown
        return NOMINAL_STRESS[law](stretch, lam, mu)

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
