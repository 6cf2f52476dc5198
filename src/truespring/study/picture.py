"""The picture of a study before it is solved: what is held, what is loaded, and where the springs are."""

from pathlib import Path

from truespring.arrays import Ints
from truespring.models import Model
from truespring.outputs import Output
from truespring.potential import Stretched
from truespring.problem import Problem
from truespring.study.read import Study


def write_picture(study: Study, out: Path) -> Path:
    """Write out/STEM/check.png, the mesh with springs, supports, loads and the probe; return the file."""
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
    """Return the pairs of nodes that the springs of a model join, shape (n, 2); None where it has none."""
    potential = model.potential(problem) if model.has_springs else None
    return potential.springs if isinstance(potential, Stretched) else None
