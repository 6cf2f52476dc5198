"""The springs of a map: those of the study, or all rules for its elements."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from truespring.errors import ModelError, StudyError, nearest
from truespring.models import RULES, Springs, springs_by_rule
from truespring.problem import Problem
from truespring.study import Study

# Poisson's ratio of a lattice of plain springs in 2D and 3D, and the tolerance of values that are equal to it.
_CAUCHY, _SAME = {2: 1 / 3, 3: 1 / 4}, 0.005

_WORDS = {
    "lloyd": "springs by Lloyd's rule",
    "isotropic": "isotropic springs",
    "least-squares": "least-squares springs",
    "projected": "projected springs",
    "van-gelder": "springs by Van Gelder's rule",
    "biquadratic": "biquadratic springs",
    "gaussian": "Gaussian springs",
}

#: Variants of a rule by their name after RULE+: attributes of Springs.
VARIANTS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {"volume": {"volume": True}, "quadratic": {"element": "quadratic"}}
)

_ALL_PARAMETERS = {name for rule in RULES.values() for name in rule.parameters}


@dataclass(frozen=True, slots=True)
class MappedSprings:
    """Springs of a map, with their `name` in files and the names of equal ones (`same`)."""

    name: str
    springs: Springs
    same: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """Their name in sentences."""
        one = self.springs
        words = (
            f"springs of given stiffness ({self.name})"
            if one.rule is None
            else _WORDS.get(one.rule, f"{one.rule} springs")
        )
        words += " of second order" if one.element is not None else ""
        parameters = {name: value for name, value in one.parameters.items() if name != "element"}
        words += " with " if parameters else ""
        words += ", ".join(f"{name} {value}" for name, value in parameters.items())
        words += ", unsummed," if one.sharing == "single" else ""
        return words + (" with a volume term" if one.volume else "")


def mapped_springs(study: Study, names: Sequence[str] | None, varies_poisson: bool) -> list[MappedSprings]:
    """Return springs by names of models of the study, rules, RULE+VARIANT or "all"; None is those of the study.

    "all" are the distinct rules for the mesh and their variants, those with a volume term only if Poisson's ratio is
    not that of plain springs.
    Raises StudyError for unknown names.
    """
    own = springs_by_rule(study.entries)
    problem = study.problem
    if names is None and own:
        called = {name: _rule_name(springs) or name for name, springs in own.items()}
        unique = {name: list(called.values()).count(one) == 1 for name, one in called.items()}
        named = {called[name] if unique[name] else name: springs for name, springs in own.items()}
        return _once(named, problem, study, varies_poisson)
    found: dict[str, Springs] = {}
    for name in names or ["all"]:
        if name == "all":
            found |= _all(problem, varies_poisson)
        else:
            found[name] = _named(name, own, study)
    return _once(found, problem, study, varies_poisson)


def _rule_name(springs: Springs) -> str:
    """Return RULE or RULE+VARIANT if it gives exactly these springs, else an empty text."""
    if springs.rule is None:
        return ""
    known = {springs.rule: Springs(springs.rule), **_variants(springs.rule)}
    return next((name for name, one in known.items() if one == springs), "")


def _variants(rule: str) -> dict[str, Springs]:
    """Return the variants of a rule by name; the mesh may not suit them."""
    found = {}
    for name, attributes in VARIANTS.items():
        with suppress(ModelError):
            found[f"{rule}+{name}"] = Springs(rule, **attributes)
    needed = {f"{rule}+{name}": attributes.keys() & _ALL_PARAMETERS for name, attributes in VARIANTS.items()}
    return {name: one for name, one in found.items() if needed[name] <= set(RULES[rule].parameters)}


def _named(name: str, own: dict[str, Springs], study: Study) -> Springs:
    if name in own:
        return own[name]
    known = {known: springs for rule in RULES for known, springs in {rule: Springs(rule), **_variants(rule)}.items()}
    if name not in known:
        allowed = [*own, *RULES, *(one for one in known if one not in RULES), "all"]
        raise StudyError(f"rule '{name}' is unknown{nearest(name, allowed)}; allowed: {', '.join(allowed)}")
    rule = str(known[name].rule)
    if not RULES[rule].takes(study.problem.mesh):
        fit = [one for one in RULES if RULES[one].takes(study.problem.mesh)]
        raise StudyError(
            f"rule '{rule}' is not for {study.problem.mesh.kinds} elements, those of this study; "
            f"allowed: {', '.join(fit)}"
        )
    return known[name]


def _all(problem: Problem, varies_poisson: bool) -> dict[str, Springs]:
    found = {name: Springs(name) for name, rule in RULES.items() if rule.takes(problem.mesh)}
    assert problem.material is not None and problem.section is not None  # a body has both
    _, poisson = problem.section.apparent_moduli(problem.material)
    is_cauchy = not varies_poisson and abs(poisson - _CAUCHY[problem.mesh.dim]) <= _SAME
    for rule in list(found):
        for name, springs in _variants(rule).items():
            if not (springs.volume and is_cauchy) and _goes(problem, springs):
                found[name] = springs
    return found


def _goes(problem: Problem, springs: Springs) -> bool:
    try:
        springs.potential(problem)
    except ModelError:
        return False
    return True


def _once(found: dict[str, Springs], problem: Problem, study: Study, varies_poisson: bool) -> list[MappedSprings]:
    """Return the distinct springs; names of others with the same stiffness are kept with the first."""
    several: list[tuple[list[str], Springs]] = []
    for name, springs in found.items():
        twin = None if varies_poisson else next((one for one in several if _same(problem, one[1], springs)), None)
        if twin is not None:
            twin[0].append(name)
        elif springs not in [one for _, one in several]:
            several.append(([name], springs))
    return [MappedSprings(names[0], springs, tuple(names[1:])) for names, springs in several]


def _same(problem: Problem, one: Springs, other: Springs) -> bool:
    if one == other:
        return True
    if one.coupled or other.coupled or one.volume or other.volume or one.sharing != other.sharing:
        return False
    try:
        found = one.element_stiffness(problem), other.element_stiffness(problem)
    except ModelError:
        return False
    return bool(np.allclose(found[0], found[1], rtol=1e-6, atol=0))  # poisson = 0.3333 is 1/3
