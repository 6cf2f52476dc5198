"""Effective moduli of the springs models of a study, computed without solving."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truespring.material import Material
from truespring.models import (
    RULES,
    Finding,
    Fitness,
    Moduli,
    Springs,
    follows_poisson,
    judge,
    moduli,
    springs_by_rule,
)
from truespring.outputs import Output
from truespring.report.summary import moduli_values
from truespring.study.read import Study


@dataclass(frozen=True, eq=False)
class Realised:
    """The effective moduli of a springs model.

    Attributes:
        name: name of the model in the study.
        springs: the model.
        by_material: each material and the effective moduli for it; the material of the body first, then the regions.
        fitness: whether the springs fit all materials, and which rule fits better.
        section: a note if the section changes the moduli of the material, as plane strain does; else empty.
    """

    name: str
    springs: Springs
    by_material: tuple[tuple[Material, Moduli], ...]
    fitness: Fitness
    section: str = ""

    @property
    def titles(self) -> tuple[str, ...]:
        """A title for each entry of `by_material`; it names the material if there are several."""
        what = f"effective moduli of '{self.name}', {self.springs.label}"
        if len(self.by_material) == 1:
            return (what,)
        return tuple(
            f"{what}, where E is {material.young:g} Pa and Poisson's ratio {material.poisson:g}"
            for material, _ in self.by_material
        )


def realised_moduli(study: Study) -> Iterator[Realised]:
    """Yield the effective moduli of each springs model of a study."""
    section = study.problem.section
    words = f"in {section.words} the material has {section.moduli_words}" if section and section.moduli_words else ""
    for name, entry in springs_by_rule(study.entries).items():
        found = []
        for twin in study.problem.homogeneous:
            assert twin.material is not None  # a study has one
            found.append((twin.material, moduli(twin, entry)))
        yield Realised(name, entry, tuple(found), judge(study.problem, entry, study.tolerance), words)


def realised_values(realised: Realised) -> dict[str, Any]:
    """Return effective moduli as JSON values: for the material of the body, and under `regions` for the others."""
    (material, first), *others = realised.by_material
    fitness, better = realised.fitness, realised.fitness.better
    return {
        "label": realised.springs.label,
        "material": _material(material),
        **moduli_values(first),
        **(
            {"regions": [{"material": _material(one), **moduli_values(found)} for one, found in others]}
            if others
            else {}
        ),
        "fit": fitness.fit,
        "reasons": list(fitness.reasons),
        "better": None if better is None else {key: getattr(better, key) for key in ("rule", "element", "volume")},
        "sentence": fitness.sentence,
        "findings": finding_values(fitness.findings),
    }


def finding_values(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Return findings as JSON values; numbers that are not finite become None."""
    return [
        {
            "code": one.code,
            "numbers": {name: value if math.isfinite(value) else None for name, value in one.numbers.items()},
            "sentence": one.sentence,
        }
        for one in findings
    ]


def _material(material: Material) -> dict[str, float]:
    return {"young": material.young, "poisson": material.poisson}


def write_moduli(study: Study, realised: Sequence[Realised], out: Path) -> Path | None:
    """Write moduli.json and a plot of Young's modulus by direction to out/STEM; return the path of the plot."""
    with Output(out / study.stem, "moduli.json") as output:
        values = {one.name: realised_values(one) for one in realised}
        text = json.dumps(values, indent=2, allow_nan=False)
        (output.staging / "moduli.json").write_text(text + "\n", encoding="utf-8")
        picture = _draw_moduli(study, realised, output.staging / "figures") if realised else None
        output.publish()
    return None if picture is None else out / study.stem / "figures" / picture.name


def _draw_moduli(study: Study, realised: Sequence[Realised], folder: Path) -> Path:
    from truespring.report.young import save_young

    labels = [one.springs.label for one in realised]
    several = {
        one.springs.label if labels.count(one.springs.label) == 1 else f"{one.springs.label} ({one.name})": moduli
        for one in realised
        for moduli in [one.by_material[0][1]]
    }
    within = study.problem.section.within if study.problem.section else ""
    return save_young(several, f"material{within}", folder)


def rule_values() -> dict[str, dict[str, Any]]:
    """Return elements, effective moduli, parameters and source of each stiffness rule as JSON values."""
    return {
        name: {
            "elements": list(rule.elements),
            "idea": rule.idea,
            "realises": rule.realises,
            "shapes": dict(rule.shapes),
            "follows_poisson": follows_poisson(name),
            "coupled": rule.coupled,
            "parameters": list(rule.parameters),
            "laws": list(rule.laws),
            "source": rule.source,
        }
        for name, rule in RULES.items()
    }
