"""The verbs `verify` and `solve`: solve every model of a study, with or without comparison and report."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from truespring.cli.moduli import print_moduli
from truespring.cli.printing import console, print_each, print_file, progress, reserve, say
from truespring.cli.verb import CONVERGED, NOT_CONVERGED, Verb, add_out, add_studies, add_timeout

if TYPE_CHECKING:
    from truespring.report.result import Result


def _add(parser: argparse.ArgumentParser) -> None:
    add_studies(parser)
    add_out(parser)
    add_timeout(parser)
    parser.add_argument(
        "--animate",
        action="store_true",
        help="also write animation.gif, and animation.mp4 if imageio-ffmpeg is installed (truespring[video])",
    )


def _run(options: argparse.Namespace, comparing: bool) -> int:
    from truespring.report.summary import summary
    from truespring.report.tables import result_tables
    from truespring.report.verdict import verdict
    from truespring.study import read_studies, realised_moduli, run
    from truespring.verifying import verify_each

    studies = read_studies(options.study)
    options.launch.check_studies(studies)
    if options.launch.rank:
        shared = [run(study, None, comparing, options.timeout) for study in studies]
        return CONVERGED if all(result.converged for result in shared) else NOT_CONVERGED
    reserve(options, studies)
    screen = console(options)
    results = []
    several = verify_each(
        studies,
        options.out,
        lambda: progress(options),
        comparing=comparing,
        timeout=options.timeout,
        animate=options.animate,
    )
    for study, (result, note) in zip(studies, several, strict=True):
        results.append(result)
        if note and not options.quiet:
            say(f"note: {study.stem}: {note}")
        if not screen.quiet:
            screen.print(f"{study.stem}: {verdict(result)}")
            print_moduli(screen, study.stem, realised_moduli(study), options.verbose)
        for part in result_tables(result):
            screen.print(part)
    if comparing:
        print_file(options, "report", options.out / "report.html")
    if options.json:
        print_each({result.stem: summary(result) for result in results})
    for result in results:
        print_failures(result, options.out, shown=not screen.quiet)
    return CONVERGED if all(result.converged for result in results) else NOT_CONVERGED


def print_failures(result: "Result", out: Path, shown: bool) -> None:
    """Print on standard error which models did not converge and, unless `shown` before, their warnings."""
    from truespring.equilibrium import FINE
    from truespring.report.axis import axis_of

    for name, path in result.solutions.items():
        if path.status not in FINE:
            reached = f"reached {axis_of(result).exact(path.load_factor)}, written to {out / result.stem}"
            say(f"{result.stem}: model '{name}' is {path.status}; {reached}")
            for warning in () if shown else path.warnings:
                say(f"  {warning}")


VERIFY = Verb(
    "verify",
    "solve and compare the models of a study; write curves, figures and a report",
    _add,
    lambda options: _run(options, comparing=True),
    (
        "truespring verify strip.toml",
        "truespring verify block.toml mesh.toml --out results",
    ),
    ("verbose", "json", "quiet", "threads"),
)

SOLVE = Verb(
    "solve",
    "solve the models of a study; write curves and VTU files only",
    _add,
    lambda options: _run(options, comparing=False),
    (
        "truespring solve strip.toml",
        "truespring solve mesh.toml --timeout 600 --threads 4",
    ),
    ("verbose", "json", "quiet", "threads"),
)
