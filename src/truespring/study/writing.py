"""Write the results of a study: curves, summary, VTU series, STL, figures and report."""

import json
from collections.abc import Sequence
from pathlib import Path

from truespring.equilibrium import Solution
from truespring.outputs import Output, write_whole
from truespring.reactions import moved_supports
from truespring.report.command import command_line
from truespring.report.curves import write_curves, write_reactions
from truespring.report.histories import write_histories
from truespring.report.paraview import NAME as PARAVIEW
from truespring.report.paraview import paraview_script
from truespring.report.result import Result
from truespring.report.series import SERIES, Form, write_mesh, write_stl
from truespring.report.summary import summary
from truespring.study.case import Case


def output(case: Case | Result, out: Path) -> Output:
    """Open the output folder of a case, out/STEM."""
    return Output(out / case.stem, "summary.json")


def write(result: Result, out: Path, report: bool = True, animate: bool = False) -> None:
    """Write curves, summary, VTU series and STL of a study to out/STEM.

    With `report` also figures and report.html, with `animate` animation.gif and, with imageio-ffmpeg, animation.mp4.
    """
    with output(result, out) as own:
        for name, path in result.solutions.items():
            write_model(path, own, name, result.form)
        write_rest(result, own, verify_command([result], out, animate), report, animate)


def write_model(path: Solution, output: Output, name: str, form: Form = "vtu") -> None:
    """Write the levels of one model in a form, and its STL file."""
    SERIES[form].write(path, output.staging, name)
    write_stl(path, output.staging / f"deformed_{name}.stl")


def write_rest(result: Result, output: Output, command: str | None, report: bool = True, animate: bool = False) -> str:
    """Write the files that cover all models and publish the output; return a note on an animation that is missing.

    Figures and report are written only with `report`, animation.gif and animation.mp4 only with `animate`. The report
    shows `command`, the command line that repeats the run.
    """
    folder = output.staging
    write_curves(result, folder / "curves.csv")
    write_histories(result, folder)
    if moved_supports(result.problem):
        write_reactions(result, folder / "reactions.csv")
    _write_script(result, folder)
    if result.problem.mesh.element != "line":
        write_mesh(result.problem.mesh, folder / "mesh.vtu", result.problem.loading.held)
    note = ""
    if animate:
        from truespring.report.animation import write_animation

        note = write_animation(result, folder)
    if report:
        from truespring.report.downloads import films_in
        from truespring.report.figures import save_figures
        from truespring.report.page import write_page

        save_figures(result, folder / "figures")
        write_page([result], folder / "report.html", command, [films_in(folder)])
    text = json.dumps(summary(result), indent=2, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    output.publish()
    return note


def _write_script(result: Result, folder: Path) -> None:
    """Write the script that opens the models with states in ParaView, deformed; nothing without any."""
    names = {name: f"{name}{SERIES[result.form].suffix}" for name, path in result.solutions.items() if path.states}
    if names:
        shown = result.model if result.model in names else next(iter(names))
        flat = result.problem.mesh.dim == 2
        script = paraview_script(names, str(shown), "displacement", flat)
        (folder / PARAVIEW).write_text(script, encoding="utf-8")


def write_overview(results: Sequence[Result], out: Path, animate: bool = False) -> None:
    """Write out/report.html over several studies that were written before; for one study, copy its report."""
    from truespring.report.downloads import films_in
    from truespring.report.page import render_page

    if len(results) == 1:
        page = (out / results[0].stem / "report.html").read_bytes()
    else:
        films = [films_in(out / result.stem) for result in results]
        page = render_page(results, verify_command(results, out, animate), films).encode()
    write_whole(out / "report.html", page)


def verify_command(cases: Sequence[Case | Result], out: Path, animate: bool = False) -> str | None:
    """Return the command line that runs `verify` on the studies; None if one of them has no file."""
    if not all(case.source for case in cases):
        return None
    more = ["--animate"] if animate else []
    return command_line(["verify", *(str(case.file) for case in cases), "--out", str(out), *more])
