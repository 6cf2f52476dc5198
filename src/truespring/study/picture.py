"""Draw a study before it is solved: supports, loads and springs."""

from pathlib import Path

from truespring.arrays import Ints
from truespring.models import Model
from truespring.outputs import Output
from truespring.potential import Stretched
from truespring.problem import Problem
from truespring.study.read import Study


def write_picture(study: Study, out: Path) -> Path:
    """Draw mesh, springs, supports, loads and probe to out/STEM/check.png; return the path."""
    from truespring.report.figures import save_undeformed
    from truespring.report.undeformed import Undeformed

    model = study.entries[study.model]
    with Output(out / study.stem, "check.png") as output:
        save_undeformed(
            Undeformed(study.problem, study.probe, _springs(model, study.problem), model.lines),
            output.staging / "check.png",
        )
        output.publish()
    return out / study.stem / "check.png"


def _springs(model: Model, problem: Problem) -> Ints | None:
    """Return the node numbers of the springs of a model, shape (n, 2); None for a model without springs."""
    potential = model.potential(problem) if model.has_springs else None
    return potential.springs if isinstance(potential, Stretched) else None
