"""Constitutive laws: energy density, stress and elasticity of a strain.

The tensor axes of arrays come first, then the axes of elements and points; a symmetric tensor has one axis, its
components in Voigt's order. A law accounts for the third direction of a plane body: its length is fixed in plane
strain, its stress is zero in plane stress. A law consists of two functions, the response and the energy density in
principal stretches that tests compare it with, and one entry of LAWS.
"""

from types import MappingProxyType

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError, nearest
from truespring.material import Material
from truespring.models.densities import (
    arruda_boyce_density,
    gent_density,
    green_density,
    hencky_density,
    mooney_rivlin_density,
    neo_hookean_density,
    ogden_density,
    small_density,
    yeoh_density,
)
from truespring.models.elasticity_parts import Elasticity
from truespring.models.invariants import by_invariants
from truespring.models.law import Constant, Constants, Law, Response
from truespring.models.ogden import hencky, mooney_rivlin, mooney_rivlin_fault, ogden, ogden_fault
from truespring.models.rubber import arruda_boyce, gent, neo_hookean, yeoh
from truespring.models.stretches import by_stretches
from truespring.models.symmetric import contracted, dimensions, identity, trace
from truespring.plugins import Table
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

    across = np.zeros_like(volume_change) if constants.plane_stress else lam * volume_change
    return Response(contracted(stress, strain) / 2, stress, lambda: Elasticity(lam, mu), thickness, across)


def _thickness_strain(strain: Floats, constants: Constants) -> Floats:
    """Return the strain of the third direction under a quadratic law: -lam / (lam + 2 mu) tr e in plane stress."""
    if not constants.plane_stress:
        return np.zeros(strain.shape[1:])
    return np.asarray(-constants.lam / (constants.lam + 2 * constants.mu) * trace(strain))


LAWS: Table[Law] = Table(
    "truespring.laws",
    {
        "linear": Law(
            linear,
            small_density,
            label="linear",
            source="Hooke's law of the small strain",
            finite=False,
            barrier=False,
            quadratic=True,
            trace="small",
        ),
        "saint-venant-kirchhoff": Law(
            saint_venant_kirchhoff,
            green_density,
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
            neo_hookean_density,
            current=by_invariants(neo_hookean, current=True),
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
            by_stretches(hencky),
            hencky_density,
            current=by_stretches(hencky, current=True),
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
            yeoh_density,
            current=by_invariants(yeoh, current=True),
            label="Yeoh",
            source="Yeoh, Rubber Chemistry and Technology 66, 1993",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            invariants=yeoh,
            constants=MappingProxyType(
                {
                    "c20": Constant("stress", "second coefficient of Yeoh's law", 0.2),
                    "c30": Constant("stress", "third coefficient of Yeoh's law", 0.05),
                }
            ),
        ),
        "gent": Law(
            by_invariants(gent),
            gent_density,
            current=by_invariants(gent, current=True),
            label="Gent",
            source="Gent, Rubber Chemistry and Technology 69, 1996",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            invariants=gent,
            limit="Gent's law has no finite energy where I1 - 3 at constant volume reaches jm; this may be the reason",
            constants=MappingProxyType(
                {
                    "jm": Constant(
                        None, "limit of I1 - 3 in Gent's law, at constant volume", 30.0, smallest=0.0, exclusive=True
                    )
                }
            ),
        ),
        "arruda-boyce": Law(
            by_invariants(arruda_boyce),
            arruda_boyce_density,
            current=by_invariants(arruda_boyce, current=True),
            label="Arruda-Boyce",
            source="Arruda and Boyce, Journal of the Mechanics and Physics of Solids 41, 1993; series of five terms",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            invariants=arruda_boyce,
            constants=MappingProxyType(
                {
                    "locking_stretch": Constant(
                        None, "stretch at which chains are extended", 2.8, smallest=1.0, exclusive=True
                    )
                }
            ),
        ),
        "mooney-rivlin": Law(
            by_stretches(mooney_rivlin),
            mooney_rivlin_density,
            current=by_stretches(mooney_rivlin, current=True),
            label="Mooney-Rivlin",
            source="Mooney, Journal of Applied Physics 11, 1940; Rivlin 1948",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            constants=MappingProxyType(
                {"c01": Constant("stress", "coefficient of I2 - 3 in the Mooney-Rivlin law", 0.2, smallest=0.0)}
            ),
            fault=mooney_rivlin_fault,
        ),
        "ogden": Law(
            by_stretches(ogden),
            ogden_density,
            current=by_stretches(ogden, current=True),
            label="Ogden",
            source="Ogden, Proceedings of the Royal Society A 326, 1972",
            finite=True,
            barrier=True,
            quadratic=False,
            trace="logarithmic",
            constants=MappingProxyType(
                {
                    "alpha1": Constant(None, "first exponent of Ogden's law", 1.3),
                    "mu2": Constant("stress", "second part of the shear modulus in Ogden's law", 0.1, 0.0, 0.0),
                    "alpha2": Constant(None, "second exponent of Ogden's law", 5.0, 0.0),
                    "mu3": Constant("stress", "third part of the shear modulus in Ogden's law", 0.2, 0.0, 0.0),
                    "alpha3": Constant(None, "third exponent of Ogden's law", -2.0, 0.0),
                }
            ),
            fault=ogden_fault,
        ),
    },
    Law,
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
                f"law = '{name}' requires {key} [{constant.unit}], {constant.meaning}: add it to the material"
            )
        if not constant.allows(value):
            found = f"{key} = {value:g}{constant.unit_after_value}"
            raise ModelError(f"{found}: law = '{name}' requires {constant.range_words}")
        values[key] = value
    fault = law.fault(material.lame, values) if law.fault is not None else ""
    if fault:
        raise ModelError(f"law = '{name}': {fault}")
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
