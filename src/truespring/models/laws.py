"""Constitutive laws: from the strain to energy density, stress and elasticity.

Arrays have their tensor axes first, then those of elements and points; a symmetric tensor has one
axis, its components in Voigt's order. In the plane the third direction is settled here: in plane
strain it keeps its length, in plane stress it takes the one that leaves it free of stress. A law is
one function and one line in LAWS.
"""

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from truespring.arrays import Floats
from truespring.models.strain import voigt_pairs
from truespring.models.symmetric import (
    contracted,
    determinant,
    dimensions,
    dyad,
    identity,
    inverted,
    outer,
    swapped,
    trace,
)


@dataclass(frozen=True, slots=True)
class Constants:
    """What a law needs: the Lamé constants [Pa] and how the third direction behaves.

    The constants are numbers, or arrays of shape (n_elements, 1) where materials differ.
    `lam_plane` is 2 lam mu / (lam + 2 mu) in plane stress, lam otherwise: the constant with which a
    quadratic law within the plane accounts for the third direction.
    """

    lam: float | Floats
    mu: float | Floats
    plane_stress: bool

    @property
    def lam_plane(self) -> float | Floats:
        """The first Lamé constant within the plane [Pa]."""
        return 2 * self.lam * self.mu / (self.lam + 2 * self.mu) if self.plane_stress else self.lam

    def part(self, first: int, last: int) -> "Constants":
        """Return those of a slice of the elements."""
        if np.ndim(self.lam) == 0:
            return self
        return Constants(np.asarray(self.lam)[first:last], np.asarray(self.mu)[first:last], self.plane_stress)


@dataclass(frozen=True, slots=True)
class Response:
    """What a law answers.

    Attributes:
        energy: per reference volume [J/m^3]; infinite where the law does not reach.
        stress: second Piola-Kirchhoff stress [Pa], axes (component, ...); of the linear law, the stress.
        elasticity: makes its derivative by the Green strain [Pa], axes (component, component, ...): a function,
            for it costs most and energy and forces do not need it. A component of the strain stands for both of
            its mirror images, so that a change of strain of e.g. e_xy multiplies twice.
        thickness_stretch: length of the third direction over its rest length; 1 where it is held or in 3D.
        across: Kirchhoff stress of the third direction [Pa], zero in plane stress; of the linear law, the stress.
    """

    energy: Floats
    stress: Floats
    elasticity: Callable[[], Floats]
    thickness_stretch: Floats
    across: Floats


@dataclass(frozen=True, slots=True)
class Law:
    """A table entry: `respond` takes the strain measure named by `finite`.

    A finite law takes the right Cauchy-Green tensor C = F^T F and is frame invariant; a law that is
    not finite takes the small strain (F + F^T) / 2 - I. A law with a `barrier` has infinite energy
    where an element is inverted; C alone cannot tell that. In 3D and plane strain lambda's part of the
    energy is lam/2 (ln J)^2 of a `logarithmic` law, else lam/2 times the squared trace of its strain.
    """

    respond: Callable[[Floats, Constants], Response]
    finite: bool
    barrier: bool
    logarithmic: bool
    label: str


def linear(strain: Floats, constants: Constants) -> Response:
    """Hooke: W = lam/2 (tr e)^2 + mu e : e of the small strain."""
    return _quadratic(strain, constants, 1.0 + _thickness_strain(strain, constants))


def saint_venant_kirchhoff(C: Floats, constants: Constants) -> Response:
    """W = lam/2 (tr E)^2 + mu E : E of the Green strain E = (C - I) / 2."""
    strain = (C - identity(C)) / 2
    # The thickness is the root of 1 + 2 E_33; the law itself goes on where that is negative.
    thickness = np.sqrt(np.maximum(1 + 2 * _thickness_strain(strain, constants), 0.0))
    return _quadratic(strain, constants, thickness)


def _quadratic(strain: Floats, constants: Constants, thickness: Floats) -> Response:
    lam, mu = constants.lam_plane, constants.mu
    dim, volume_change = dimensions(strain), trace(strain)
    stress = 2 * mu * strain
    stress[:dim] += lam * volume_change

    def elasticity() -> Floats:
        result = np.zeros((len(strain), *strain.shape))
        result[:dim, :dim] = lam
        for component in range(len(strain)):
            result[component, component] += 2 * mu if component < dim else mu
        return result

    across = np.zeros_like(volume_change) if constants.plane_stress else lam * volume_change
    return Response(contracted(stress, strain) / 2, stress, elasticity, thickness, across)


def _thickness_strain(strain: Floats, constants: Constants) -> Floats:
    """Strain of the third direction under a quadratic law: -lam / (lam + 2 mu) tr e in plane stress."""
    if not constants.plane_stress:
        return np.zeros(strain.shape[1:])
    return np.asarray(-constants.lam / (constants.lam + 2 * constants.mu) * trace(strain))


def neo_hookean(C: Floats, constants: Constants) -> Response:
    """W = mu/2 (tr C - 3) - mu ln J + lam/2 (ln J)^2, J the volume ratio (Simo and Pister 1984).

    In plane stress C_33 solves mu (C_33 - 1) + lam ln J = 0 at every point; eliminated, it turns
    lam into lam 2 mu C_33 / (2 mu C_33 + lam) in the elasticity.
    """
    lam, mu = constants.lam, constants.mu
    det = determinant(C)
    valid = det > 0
    det = np.where(valid, det, 1.0)
    C_33 = _free_thickness(np.log(det), lam / mu) if constants.plane_stress else np.ones_like(det)
    valid &= np.isfinite(C_33)
    C_33 = np.where(valid, C_33, 1.0)
    log_J = (np.log(det) + np.log(C_33)) / 2
    inverse = inverted(np.where(valid, C, identity(C)))
    stress = mu * identity(C) + (lam * log_J - mu) * inverse

    def elasticity() -> Floats:
        eliminated = lam * 2 * mu * C_33 / (2 * mu * C_33 + lam) if constants.plane_stress else lam
        return eliminated * outer(inverse, inverse) + (mu - lam * log_J) * swapped(inverse)

    stretch = trace(C) - dimensions(C) + (C_33 - 1)
    energy = np.where(valid, mu / 2 * stretch - mu * log_J + lam / 2 * log_J**2, np.inf)
    return Response(energy, stress, elasticity, np.sqrt(C_33), mu * (C_33 - 1) + lam * log_J)


def _free_thickness(log_det: Floats, ratio: float | Floats) -> Floats:
    """Solve C_33 - 1 + ratio/2 (log_det + ln C_33) = 0 for C_33 > 0, by Newton in y = ln C_33.

    e^y + ratio/2 y is convex and rises where ratio > 0, so that from the second step on Newton
    descends monotonically. Below zero (ratio in (-2/3, 0)) there is none under strong compression;
    what is returned there is not a number.
    """
    half = ratio / 2
    y = np.clip(-half * log_det / (1 + half), -50.0, 50.0)
    for _ in range(100):
        step = (np.expm1(y) + half * (log_det + y)) / (np.exp(y) + half)
        y = y - np.clip(step, -2.0, 2.0)
        if np.abs(step).max() <= 1e-15 * max(1.0, float(np.abs(y).max())):
            break
    solved = np.abs(np.expm1(y) + half * (log_det + y)) <= 1e-12 * (1 + np.abs(half * log_det))
    return np.where(solved & (np.exp(y) + half > 0), np.exp(y), np.nan)


def hencky(C: Floats, constants: Constants) -> Response:
    """W = mu |ln U|^2 + lam/2 (tr ln U)^2, U the right stretch; Hencky's law in Kirchhoff stress.

    With C = sum c_i N_i (x) N_i and e_i = ln(c_i) / 2 the stress is S_i = (2 mu e_i + lam tr e) / c_i.
    Its shear elasticities are the divided differences (S_i - S_j) / (c_i - c_j), written with
    log1p so that equal stretches need no special case. Plane stress keeps the law, with lam_plane.
    """
    lam, mu = constants.lam_plane, constants.mu
    dim = dimensions(C)
    c, N = _principal(C)
    valid = c[0] > 0
    c = np.where(valid, c, 1.0)
    strain = np.log(c) / 2
    volume_change = strain.sum(axis=0)
    tau = 2 * mu * strain + lam * volume_change
    stress = sum(tau[i] / c[i] * dyad(N[:, i], N[:, i]) / 2 for i in range(dim))

    def elasticity() -> Floats:
        result = np.zeros((len(C), *C.shape))
        own = [dyad(N[:, i], N[:, i]) / 2 for i in range(dim)]
        for i in range(dim):
            for j in range(dim):
                normal = (2 * mu * (i == j) + lam) / (c[i] * c[j]) - 2 * (i == j) * tau[i] / c[i] ** 2
                result += normal * outer(own[i], own[j])
            for j in range(i):
                shear = mu * _log_difference(c[i], c[j]) - mu * np.log(c[j]) - lam * volume_change
                mixed = dyad(N[:, i], N[:, j])
                result += shear / (c[i] * c[j]) * outer(mixed, mixed)
        return result

    energy = np.where(valid, mu * (strain**2).sum(axis=0) + lam / 2 * volume_change**2, np.inf)
    free = -constants.lam / (constants.lam + 2 * constants.mu) * volume_change if constants.plane_stress else 0.0
    across = np.zeros_like(volume_change) if constants.plane_stress else lam * volume_change
    return Response(energy, np.asarray(stress), elasticity, np.exp(free + np.zeros_like(volume_change)), across)


def _principal(C: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues, ascending, axes (which, ...), and unit eigenvectors, axes (direction, which, ...)."""
    dim = dimensions(C)
    full = np.empty((*C.shape[1:], dim, dim))
    for component, (i, j) in zip(C, voigt_pairs(dim), strict=True):
        full[..., i, j] = full[..., j, i] = component
    values, vectors = np.linalg.eigh(full)
    first = np.moveaxis(values, -1, 0), np.moveaxis(vectors, (-2, -1), (0, 1))
    return np.ascontiguousarray(first[0]), np.ascontiguousarray(first[1])


def _log_difference(a: Floats, b: Floats) -> Floats:
    """b (ln a - ln b) / (a - b), 1 where a = b."""
    x = (a - b) / b
    near = np.abs(x) < 0.5
    logarithm = np.where(near, np.log1p(np.where(near, x, 0.0)), np.log(a) - np.log(b))
    return np.divide(logarithm, x, out=np.ones_like(x), where=x != 0)


LAWS: MappingProxyType[str, Law] = MappingProxyType(
    {
        "linear": Law(linear, finite=False, barrier=False, logarithmic=False, label="linear FEM"),
        "saint-venant-kirchhoff": Law(
            saint_venant_kirchhoff, finite=True, barrier=False, logarithmic=False, label="St. Venant-Kirchhoff FEM"
        ),
        "neo-hookean": Law(neo_hookean, finite=True, barrier=True, logarithmic=True, label="neo-Hookean FEM"),
        "hencky": Law(hencky, finite=True, barrier=True, logarithmic=True, label="Hencky FEM"),
    }
)
