"""Draw a study before it is solved: supports, loads and springs."""

from pathlib import Path

from truespring.outputs import Output
from truespring.study.read import Study


def write_picture(study: Study, out: Path) -> Path:
    """Draw mesh, springs, supports, loads and probe to out/STEM/check.png; return the path."""
    from truespring.report.figures import save_undeformed
    from truespring.report.undeformed import Undeformed, spring_lines

    model = study.entries[study.model]
    springs = spring_lines(model.potential(study.problem)) if model.has_springs else None
    with Output(out / study.stem, "check.png") as output:
        save_undeformed(
            Undeformed(study.problem, study.probe, springs, model.lines),
            output.staging / "check.png",
        )
        output.publish()
    return out / study.stem / "check.png"
