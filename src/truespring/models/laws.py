"""Constitutive laws: energy density, stress and elasticity of a strain.

The tensor axes of arrays come first, then the axes of elements and points; a symmetric tensor has one axis, its
components in Voigt's order. A law accounts for the third direction of a plane body: its length is fixed in plane
strain, its stress is zero in plane stress. A law consists of two functions, the response and the energy density in
principal stretches that tests compare it with, and one entry of LAWS.
"""

from collections.abc import Callable
from types import MappingProxyType
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError, nearest
from truespring.material import Material
from truespring.models.invariants import by_invariants
from truespring.models.law import Constant, Constants, Law, Response
from truespring.models.rubber import arruda_boyce, gent, neo_hookean, yeoh
from truespring.models.strain import voigt_pairs
from truespring.models.symmetric import (
    contracted,
    dimensions,
    dyad,
    identity,
    outer,
    trace,
)
from truespring.problem import Problem

# Largest difference of young (relative) and poisson (absolute) between a material and a law whose constants determine
# both at small strain.
_SAME_MATERIAL = 0.01


def linear(strain: Floats, constants: Constants) -> Response:
    """Return the response of Hooke's law, W = lam/2 (tr e)^2 + mu e : e of the small strain e."""
    return _quadratic(strain, constants, 1.0 + _thickness_strain(strain, constants))


def saint_venant_kirchhoff(C: Floats, constants: Constants) -> Response:
    """Return the response of W = lam/2 (tr E)^2 + mu E : E of the Green strain E = (C - I) / 2."""
    strain = (C - identity(C)) / 2
    # The thickness stretch is sqrt(1 + 2 E_33); energy and stress are defined where that is imaginary, too.
    thickness = np.sqrt(np.maximum(1 + 2 * _thickness_strain(strain, constants), 0.0))
    return _quadratic(strain, constants, thickness)


def _quadratic(strain: Floats, constants: Constants, thickness: Floats) -> Response:
    """Return the response of a law that is quadratic in `strain`, with the given thickness stretch."""
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
    """Return the strain of the third direction under a quadratic law: -lam / (lam + 2 mu) tr e in plane stress."""
    if not constants.plane_stress:
        return np.zeros(strain.shape[1:])
    return np.asarray(-constants.lam / (constants.lam + 2 * constants.mu) * trace(strain))


def hencky(C: Floats, constants: Constants) -> Response:
    """Return the response of W = mu |ln U|^2 + lam/2 (tr ln U)^2, U the right stretch tensor (Hencky 1928).

    With C = sum c_i N_i (x) N_i and e_i = ln(c_i) / 2 the stress is S_i = (2 mu e_i + lam tr e) / c_i.
    The shear components of the elasticity are the divided differences (S_i - S_j) / (c_i - c_j), computed with
    log1p so that equal stretches need no special case. In plane stress, lam_plane replaces lam.
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
    """Return the eigenvalues, ascending, axes (number, ...), and unit eigenvectors, axes (direction, number, ...)."""
    dim = dimensions(C)
    full = np.empty((*C.shape[1:], dim, dim))
    for component, (i, j) in zip(C, voigt_pairs(dim), strict=True):
        full[..., i, j] = full[..., j, i] = component
    values, vectors = np.linalg.eigh(full)
    first = np.moveaxis(values, -1, 0), np.moveaxis(vectors, (-2, -1), (0, 1))
    return np.ascontiguousarray(first[0]), np.ascontiguousarray(first[1])


def _log_difference(a: Floats, b: Floats) -> Floats:
    """Return b (ln a - ln b) / (a - b), 1 where a = b."""
    x = (a - b) / b
    near = np.abs(x) < 0.5
    logarithm = np.where(near, np.log1p(np.where(near, x, 0.0)), np.log(a) - np.log(b))
    return np.divide(logarithm, x, out=np.ones_like(x), where=x != 0)


def _small_density(stretch: Any, constants: Constants) -> Any:
    return _quadratic_density(stretch - 1, constants)


def _green_density(stretch: Any, constants: Constants) -> Any:
    return _quadratic_density((stretch**2 - 1) / 2, constants)


def _hencky_density(stretch: Any, constants: Constants) -> Any:
    return _quadratic_density(np.log(stretch), constants)


def _quadratic_density(strain: Any, constants: Constants) -> Any:
    """Return mu e : e + lam/2 (tr e)^2 of the three principal strains [J/m^3]."""
    return constants.mu * (strain**2).sum() + constants.lam / 2 * strain.sum() ** 2


def _neo_hookean_density(stretch: Any, constants: Constants) -> Any:
    log_J = np.log(stretch).sum()
    return constants.mu * (((stretch**2).sum() - 3) / 2 - log_J) + constants.lam / 2 * log_J**2


def _shape_density(psi: Callable[[Any], Any], stretch: Any, constants: Constants) -> Any:
    """Return psi(I1b) + bulk/2 (ln J)^2 of the principal stretches [J/m^3], I1b of the stretches over J^(1/3)."""
    J = stretch.prod()
    return psi((stretch**2).sum() / J ** (2 / 3)) + constants.bulk / 2 * np.log(J) ** 2


def _yeoh_density(stretch: Any, constants: Constants) -> Any:
    c10, c20, c30 = constants.mu / 2, constants["c20"], constants["c30"]
    return _shape_density(
        lambda trace: c10 * (trace - 3) + c20 * (trace - 3) ** 2 + c30 * (trace - 3) ** 3, stretch, constants
    )


def _gent_density(stretch: Any, constants: Constants) -> Any:
    jm = constants["jm"]
    return _shape_density(lambda trace: -constants.mu * jm / 2 * np.log((jm - trace + 3) / jm), stretch, constants)


def _arruda_boyce_density(stretch: Any, constants: Constants) -> Any:
    N = constants["locking_stretch"] ** 2
    m = constants.mu / (1 + 3 / (5 * N) + 99 / (175 * N**2) + 513 / (875 * N**3) + 42039 / (67375 * N**4))

    def psi(trace: Any) -> Any:
        return m * (
            (trace - 3) / 2
            + (trace**2 - 9) / (20 * N)
            + 11 * (trace**3 - 27) / (1050 * N**2)
            + 19 * (trace**4 - 81) / (7000 * N**3)
            + 519 * (trace**5 - 243) / (673750 * N**4)
        )

    return _shape_density(psi, stretch, constants)


LAWS: MappingProxyType[str, Law] = MappingProxyType(
    {
        "linear": Law(
            linear,
            _small_density,
            label="linear",
            source="Hooke's law of the small strain",
            finite=False,
            barrier=False,
            quadratic=True,
            trace="small",
        ),
        "saint-venant-kirchhoff": Law(
            saint_venant_kirchhoff,
            _green_density,
            label="St. Venant-Kirchhoff",
            source="Hooke's law of the Green strain; Bonet and Wood, Nonlinear Continuum Mechanics, 5.4",
            finite=True,
            barrier=False,
            quadratic=True,
            trace="green",
            domain=(1 / np.sqrt(3), np.inf),
        ),
        "neo-hookean": Law(
            by_invariants(neo_hookean),
            _neo_hookean_density,
            label="neo-Hookean",
            source="Simo and Pister 1984; Bonet and Wood, Nonlinear Continuum Mechanics, 5.4.3",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            invariants=neo_hookean,
            constant_springs=True,
        ),
        "hencky": Law(
            hencky,
            _hencky_density,
            label="Hencky",
            source="Hencky 1928: quadratic in ln U",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            domain=(0.0, np.e),
        ),
        "yeoh": Law(
            by_invariants(yeoh),
            _yeoh_density,
            label="Yeoh",
            source="Yeoh, Rubber Chemistry and Technology 66, 1993",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            volumetric="bulk",
            invariants=yeoh,
            constants=MappingProxyType(
                {
                    "c20": Constant("stress", "second coefficient of Yeoh's law", 200.0),
                    "c30": Constant("stress", "third coefficient of Yeoh's law", 50.0),
                }
            ),
        ),
        "gent": Law(
            by_invariants(gent),
            _gent_density,
            label="Gent",
            source="Gent, Rubber Chemistry and Technology 69, 1996",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            volumetric="bulk",
            invariants=gent,
            constants=MappingProxyType(
                {"jm": Constant(None, "limit of I1 - 3 in Gent's law, at constant volume", 30.0, smallest=1e-6)}
            ),
        ),
        "arruda-boyce": Law(
            by_invariants(arruda_boyce),
            _arruda_boyce_density,
            label="Arruda-Boyce",
            source="Arruda and Boyce, Journal of the Mechanics and Physics of Solids 41, 1993; series of five terms",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            volumetric="bulk",
            invariants=arruda_boyce,
            constants=MappingProxyType(
                {"locking_stretch": Constant(None, "stretch at which chains are extended", 2.8, smallest=1.0)}
            ),
        ),
    }
)


def material_constants() -> dict[str, Constant]:
    """Return the constants of all laws by name, without lam and mu: the optional keys of a material."""
    return {name: constant for law in LAWS.values() for name, constant in law.constants.items()}


def law_constants(problem: Problem, name: str) -> Constants:
    """Return the constants of a law for the elements of a problem [SI], numbers or arrays of shape (n_elements, 1).

    Raises ModelError if a material has an unknown constant, lacks a constant of the law, has one out of range, or if
    its young and poisson differ from those of the law at small strain.
    """
    plane_stress = problem.section is not None and problem.section.free_thickness
    law = LAWS[name]
    found = {material: _values(material, name) for material in problem.materials}
    if len(found) == 1:
        ((material, values),) = found.items()
        return Constants(*material.lame, plane_stress, values)
    lam, mu = (problem.of_elements(value)[:, None] for value in (lambda one: one.lame.lam, lambda one: one.lame.mu))

    def by_element(key: str) -> Floats:
        return problem.of_elements(lambda material: found[material][key])[:, None]

    return Constants(lam, mu, plane_stress, {key: by_element(key) for key in law.constants})


def _values(material: Material, name: str) -> dict[str, float]:
    """Return the constants of a law for a material by name [SI], with default values."""
    law, known, has = LAWS[name], material_constants(), dict(material.constants)
    for key in has.keys() - known.keys():
        allowed = f"allowed: {', '.join(known)}" if known else "allowed: only young, poisson and density"
        raise ModelError(f"material: constant '{key}' is unknown{nearest(key, known)}; {allowed}")
    values: dict[str, float] = {}
    for key, constant in law.constants.items():
        value = has.get(key, constant.default)
        if value is None:
            raise ModelError(
                f"law = '{name}' requires {key} [{constant.unit}], {constant.meaning}: add it to the material, next to "
                "young and poisson"
            )
        if not constant.smallest <= value <= constant.largest:
            raise ModelError(
                f"{key} = {value:g} {constant.unit}: law = '{name}' takes {constant.smallest:g} to {constant.largest:g}"
            )
        values[key] = value
    if law.lame is not None:
        _require_same_moduli(material, name, values)
    return values


def _require_same_moduli(material: Material, name: str, values: dict[str, float]) -> None:
    """Raise ModelError if young and poisson of a material differ from those of the law at small strain."""
    lame = LAWS[name].lame
    assert lame is not None
    lam, mu = lame(values)
    young, poisson = mu * (3 * lam + 2 * mu) / (lam + mu), lam / 2 / (lam + mu)
    if abs(young / material.young - 1) > _SAME_MATERIAL or abs(poisson - material.poisson) > _SAME_MATERIAL:
        values_text = ", ".join(f"{key} = {value:g}" for key, value in values.items())
        raise ModelError(
            f"law = '{name}' with {values_text} has young = {young:g} Pa and poisson = {poisson:g} at small strain, "
            f"the material {material.young:g} Pa and {material.poisson:g}: change these or the constants of the law"
        )
