"""The effective moduli of springs in a sentence."""

from truespring.equilibrium import Solution
from truespring.models import moduli_findings
from truespring.report.result import Result


def moduli_sentence(path: Solution) -> str | None:
    """Return the effective moduli of springs and those of the material; None if the path has no moduli."""
    if path.moduli is None:
        return None
    findings = [one.sentence for one in moduli_findings(path.problem, path.moduli)]
    regions = " This is for the material of the body, outside its regions." if path.problem.regions else ""
    return f"{'; '.join(findings)}.{regions}"


def material_name(result: Result) -> str:
    """Return "material", with its section where the moduli within a section differ from those of the material."""
    return "material" + (result.problem.section.within if result.problem.section else "")
