"""Unknown parameters of a model: the stiffness of hourglass modes, and the moduli of the materials."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.calibration.unknowns import Columns, Unknowns, material_name
from truespring.material import Material
from truespring.models import LAWS, RULES, Model, Springs
from truespring.models.gaussian_weights import HOURGLASS_LIMITS, hourglass_values
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.units import to_si

# Step of central differences by an unknown, of size 1.
_STEP = 1e-4
# Distance of `hourglass` to the limit of stability below which the limit, and not the data, determines it.
_AT_LIMIT = 0.02


@dataclass(frozen=True, eq=False)
class ModelUnknowns(Unknowns):
    """Factors on parameters of springs whose potential is built anew for each value.

    Attributes:
        springs: the springs of the rule.
    """

    springs: Springs

    def potential(self, values: Floats) -> Potential:
        """Return the potential with these unknowns (n,); raise ModelError if there is none."""
        return self.model(values).potential(self.problem)

    def forces(self, positions: Floats, values: Floats | None = None) -> Columns:
        """Return the derivative of the internal force by each unknown [N], sparse, shape (n_dof, n).

        By central differences: exact where the force is linear or quadratic in an unknown.
        """
        at = self.start if values is None else values
        columns = []
        for step in _STEP * np.eye(len(self)):
            ahead, behind = (self.potential(one).gradient(positions) for one in (at + step, at - step))
            columns.append((ahead - behind).ravel() / (2 * _STEP))
        return sparse.csr_array(np.stack(columns, axis=1))

    def offset(self, positions: Floats) -> Floats:
        """Return the internal force of the rule minus its derivative by the unknowns [N], shape (n_dof,)."""
        whole = self.potential(self.start).gradient(positions).ravel()
        return np.asarray(whole - self.forces(positions) @ self.start)


@dataclass(frozen=True, eq=False)
class HourglassUnknown(ModelUnknowns):
    """A factor on `hourglass`, the stiffness of the hourglass modes over that of finite elements."""

    of_what = "hourglass"

    @property
    def _rule(self) -> float:
        """The value of the springs of the rule, the same for all elements."""
        return float(hourglass_values(self.problem, self.springs.hourglass)[0])

    def _value(self, values: Floats) -> float:
        return float(values[0]) * self._rule

    def model(self, values: Floats) -> Springs:
        """Return the springs with this factor (1,)."""
        return replace(self.springs, hourglass=self._value(values))

    def entry(self, study: dict[str, Any], name: str, values: Floats, files: Sequence[str]) -> dict[str, Any]:
        """Return the entry of the springs of the rule with the calibrated `hourglass`."""
        return {**study["models"][name], "hourglass": self._value(values)}

    def warnings(self, values: Floats) -> tuple[str, ...]:
        """Return a warning if the calibrated `hourglass` is at the limit of stability."""
        limit = max(_limits(self.problem))
        if self._value(values) > limit + _AT_LIMIT:
            return ()
        return (
            f"hourglass = {self._value(values):.6g} is at the limit of stability, {limit:g}: the data do not determine "
            "it; use the default, more elements through the depth, or elements closer to cubes or squares",
        )

    def sentence(self, values: Floats) -> str:
        """Return the calibrated `hourglass` and that of the rule as a sentence."""
        return f"hourglass = {self._value(values):.6g}, by the rule {self._rule:.6g}."


def _limits(problem: Problem) -> list[float]:
    """Return the limits of `hourglass` of the kinds of elements with hourglass modes."""
    return [HOURGLASS_LIMITS[kind] for kind in problem.mesh.element_kinds if kind in HOURGLASS_LIMITS]


def hourglass_fault(problem: Problem, springs: Springs) -> str:
    """Return why the key `hourglass` of springs cannot be fitted on the body of a problem; empty if it can."""
    if springs.rule is None or "hourglass" not in RULES[springs.rule].parameters:
        return "have no such parameter"
    if not _limits(problem):
        return f"have no hourglass modes on {problem.mesh.kinds} elements"
    values = np.unique(hourglass_values(problem, springs.hourglass))
    if len(values) > 1:
        several = ", ".join(f"{value:.4g}" for value in values.tolist())
        return f"have several values of hourglass by default, one for each material ({several}): set hourglass"
    return ""


def hourglass_unknown(problem: Problem, springs: Springs, kind: str) -> HourglassUnknown:
    """Return the unknown `hourglass` of springs without `hourglass_fault`."""
    found = HourglassUnknown(kind, ("hourglass",), problem, springs)
    found.potential(found.start)  # raises the usual errors
    return found


@dataclass(frozen=True, eq=False)
class MaterialUnknowns(ModelUnknowns):
    """Factors on the moduli of the materials of a body, to which the internal force is proportional."""

    of_what = "the moduli of a material"

    def model(self, values: Floats) -> "ScaledMaterials":
        """Return the springs of the rule with scaled materials, by the factors (n,)."""
        return ScaledMaterials(self.springs, tuple(zip(self.problem.materials, values.tolist(), strict=True)))

    def entry(self, study: dict[str, Any], name: str, values: Floats, files: Sequence[str]) -> dict[str, Any]:
        """Return the entry of the springs of the rule; the moduli in `[material]` and `[[region]]` are changed."""
        factors = dict(zip(self.problem.materials, values.tolist(), strict=True))
        materials = [self.problem.material, *(region.material for region in self.problem.regions)]
        for table, material in zip([study["material"], *study.get("region", [])], materials, strict=True):
            _scale_table(table, factors.get(material, 1.0) if material is not None else 1.0)
        return dict(study["models"][name])

    def sentence(self, values: Floats) -> str:
        """Return the factors as a sentence."""
        factors = (f"{name} by {value:.6g}" for name, value in zip(self.names, values.tolist(), strict=True))
        return f"Moduli multiplied: {', '.join(factors)}."


def material_unknowns(problem: Problem, springs: Springs, kind: str) -> MaterialUnknowns:
    """Return a factor on the moduli of each material of a body."""
    names = tuple(material_name(number) for number in range(len(problem.materials)))
    found = MaterialUnknowns(kind, names, problem, springs)
    found.potential(found.start)  # raises the usual errors
    return found


@dataclass(frozen=True, eq=False)
class ScaledMaterials(Model):
    """Springs on a body whose materials have their moduli multiplied by factors.

    Attributes:
        springs: the springs.
        factors: materials and their factors; others are unchanged.
    """

    springs: Springs
    factors: tuple[tuple[Material, float], ...]

    kind = "springs"
    has_springs = True

    @property
    def label(self) -> str:
        """Name in figures and tables."""
        return f"{self.springs.label}, moduli calibrated"

    @property
    def lines(self) -> str:
        """Name of the lines of the potential in figures."""
        return self.springs.lines

    def potential(self, problem: Problem) -> Potential:
        """Return the potential of the springs on a body with scaled moduli."""
        return self.springs.potential(self._scaled(problem))

    def _scaled(self, problem: Problem) -> Problem:
        """Return a problem with scaled moduli."""
        factors = dict(self.factors)
        assert problem.material is not None  # see make_unknowns
        changed = {material: scaled(material, factors.get(material, 1.0)) for material in problem.materials}
        regions = [replace(one, material=changed.get(one.material, one.material)) for one in problem.regions]
        own = changed.get(problem.material, problem.material)
        return replace(problem, material=own, regions=tuple(regions))


def scaled(material: Material, factor: float) -> Material:
    """Return a material whose moduli, of laws and fibres too, are multiplied by a factor [-]."""
    constants = {
        name: value * (factor if name in _moduli() else 1.0) for name, value in dict(material.constants).items()
    }
    fibres = None if material.fibres is None else replace(material.fibres, k1=factor * material.fibres.k1)
    return replace(material, young=factor * material.young, constants=constants, fibres=fibres)


def _moduli() -> set[str]:
    """Return the keys of a material that are moduli, and the key k1 of its fibres."""
    of_laws = {name for law in LAWS.values() for name, one in law.constants.items() if one.dimension == "stress"}
    return of_laws | {"young", "mu", "bulk", "k1"}


def _scale_table(table: dict[str, Any], factor: float) -> None:
    """Multiply the moduli in a table `[material]` or `[[region]]` of a study, and in the table of its fibres."""
    for key, value in table.items():
        if isinstance(value, dict):
            _scale_table(value, factor)
        elif key in _moduli():
            table[key] = factor * to_si(value, "stress")
