"""Laws of Gaussian springs, from the arrays of springs.npz; needs only NumPy. Formulas: docs/export/arrays.md."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

# Coefficients of the law of Arruda and Boyce.
_SERIES = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
# Newton's method for the thickness: iterations, longest step of ln C33, smallest step.
_ITERATIONS, _LONGEST_STEP, _EXACT = 100, 1.0, 1e-15


class Law:
    """A law of Gaussian springs: the energy density W(I1, y), y = ln J, in the plane without the third direction.

    Attributes:
        section: "plane stress", "plane strain", or "" in 3D.
        lam, mu: Lame constants of the elements [Pa].
    """

    def __init__(self, section: str, name: str, own: Mapping[str, Any]) -> None:
        self.section, self.name = section, name
        self.lam, self.mu = (np.asarray(own[key], dtype=float) for key in ("lam", "mu"))
        self.constants = {key: np.asarray(own[key], dtype=float) for key in own if key in _CONSTANTS}

    def of_volume(self, y: Array) -> tuple[Array, Array]:
        """Return energy density and pressure dW/dy of the neo-Hookean law, without the part of the springs [Pa]."""
        lam, mu = self.lam, self.mu
        if self.section != "plane stress":
            density, pressure = self.of_mean(y, y)
            return density, pressure + lam * y
        z = _newton(lambda z: (mu * np.expm1(z) + lam * (y + z / 2), mu * np.exp(z) + lam / 2), self._guess(y))
        y = y + z / 2
        return mu / 2 * (np.exp(z) - 3) - mu * y + lam / 2 * y**2, lam * y - mu

    def of_mean(self, y: Array, mean: Array) -> tuple[Array, Array]:
        """Return the same with lam/2 (ln of the mean J)^2, and the pressure of mu alone; not in plane stress."""
        missing = -1.0 if self.section == "plane strain" else -1.5
        return missing * self.mu - self.mu * y + self.lam / 2 * mean**2, np.broadcast_to(-self.mu, y.shape)

    def _guess(self, y: Array) -> Array:
        """Return ln C33 at small strain."""
        return np.asarray(-2 * self.lam / (self.lam + 2 * self.mu) * y)

    def of_trace(self, trace: Array, y: Array) -> tuple[Array, Array, Array]:
        """Return W, dW/dI1 and dW/dy [Pa] at the trace of C of 3D or of the plane."""
        if self.section != "plane stress":
            return self._isochoric(trace + (self.section == "plane strain"), y)[:3]

        def slope(z: Array) -> tuple[Array, Array]:
            C33 = np.exp(z)
            _, by_trace, by_y, by_trace_trace, by_trace_y, by_y_y = self._isochoric(trace + C33, y + z / 2)
            return C33 * by_trace + by_y / 2, C33 * (by_trace + C33 * by_trace_trace + by_trace_y) + by_y_y / 4

        z = _newton(slope, self._guess(y))
        return self._isochoric(trace + np.exp(z), y + z / 2)[:3]

    def _isochoric(self, I1: Array, y: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Return psi(I1 exp(-2 y / 3)) + bulk/2 y^2 and its derivatives by I1, y, I1 I1, I1 y, y y."""
        bulk, shrunk = self.lam + 2 / 3 * self.mu, np.exp(-2 * y / 3)
        I1b = I1 * shrunk
        psi, first, second = _PSI[self.name](I1b, self.mu, self.constants)
        return (
            psi + bulk / 2 * y**2,
            first * shrunk,
            -2 / 3 * I1b * first + bulk * y,
            second * shrunk**2,
            -2 / 3 * shrunk * (first + I1b * second),
            4 / 9 * I1b * (first + I1b * second) + bulk,
        )


def _newton(slope: Callable[[Array], tuple[Array, Array]], z: Array) -> Array:
    """Return the zeros of a function that returns values and derivatives, by Newton's method with bounded steps."""
    for _ in range(_ITERATIONS):
        value, derivative = slope(z)
        step = np.clip(-value / derivative, -_LONGEST_STEP, _LONGEST_STEP)
        z = z + step
        if not (np.abs(step) > _EXACT * (1 + np.abs(z))).any():
            break
    return z


def _yeoh(x: Array, mu: Array, constants: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    c20, c30, x = constants["c20"], constants["c30"], x - 3
    return mu / 2 * x + c20 * x**2 + c30 * x**3, mu / 2 + 2 * c20 * x + 3 * c30 * x**2, 2 * c20 + 6 * c30 * x


def _gent(x: Array, mu: Array, constants: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    jm = constants["jm"]
    left = 1 - (x - 3) / jm
    left = np.where(left > 0, left, np.nan)
    return -mu * jm / 2 * np.log(left), mu / 2 / left, mu / 2 / jm / left**2


def _arruda_boyce(x: Array, mu: Array, constants: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    terms = [(i, c / constants["locking_stretch"] ** (2 * i - 2)) for i, c in enumerate(_SERIES, start=1)]
    m = mu / sum(2 * i * c * 3 ** (i - 1) for i, c in terms)
    energy = sum(m * c * (x**i - 3**i) for i, c in terms)
    first = sum(m * c * i * x ** (i - 1) for i, c in terms)
    second = sum(m * c * i * (i - 1) * x ** (i - 2) for i, c in terms if i > 1)
    return np.asarray(energy), np.asarray(first), np.asarray(second)


_PSI = {"yeoh": _yeoh, "gent": _gent, "arruda-boyce": _arruda_boyce}
_CONSTANTS = ("c20", "c30", "jm", "locking_stretch")


def fibre_energy(I4: Array, k1: Array, k2: Array) -> tuple[Array, Array]:
    """Return the energy density of fibres [J/m^3] and its derivative by the square of their stretch [Pa]."""
    strain = np.maximum(I4 - 1, 0.0)
    safe = np.where(k2 > 0, k2, 1.0)
    energy = np.where(k2 > 0, k1 / (2 * safe) * np.expm1(k2 * strain**2), k1 / 2 * strain**2)
    return energy, k1 * strain * np.exp(k2 * strain**2)
