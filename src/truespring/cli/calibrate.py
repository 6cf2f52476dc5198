"""The verb `calibrate`: fit the springs of a study to a reference."""

import argparse
from pathlib import Path

from truespring.cli.names import UNKNOWNS
from truespring.cli.printing import console, print_file, print_json, progress, reserve, say, writing
from truespring.cli.verb import CONVERGED, NOT_CONVERGED, Verb, add_out, one_of


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", help="study with the springs to fit, under its load")
    parser.add_argument("case", nargs="*", help="studies of the same body with further loads to fit")
    parser.add_argument(
        "--held-out",
        nargs="+",
        default=[],
        metavar="CASE",
        help="studies of the same body with loads that only test the fit",
    )
    parser.add_argument(
        "--unknowns",
        metavar="KIND",
        **one_of(UNKNOWNS),
        help=f"what is unknown: {', '.join(UNKNOWNS)}; default: the first that suits springs of the study",
    )
    parser.add_argument(
        "--to", metavar="NAME", help="reference model of the studies, default: neo-Hookean FEM if they have it"
    )
    parser.add_argument(
        "--markers", type=Path, metavar="FILE", help="markers (.csv) that were measured under the load of the study"
    )
    parser.add_argument(
        "--curve",
        type=Path,
        metavar="FILE",
        help="force-displacement curve (.csv) that was measured under the load of the study",
    )
    parser.add_argument(
        "--regularisation", type=float, metavar="R", help="weight of the deviation from the rule, default: 0.01"
    )
    add_out(parser)


def _run(options: argparse.Namespace) -> int:
    from truespring.calibration.page import calibration_table
    from truespring.calibration.study import calibrate_study
    from truespring.study import read_studies

    study, *others = read_studies([options.study, *options.case, *options.held_out])
    cases, held_out = others[: len(options.case)], others[len(options.case) :]
    reserve(options, [study])
    weight = {} if options.regularisation is None else {"regularisation": options.regularisation}
    with progress(options) as advance:
        fitting = None if advance is None else lambda text, share: advance(study.stem, "calibration", share)
        found = calibrate_study(
            study,
            cases,
            held_out,
            options.unknowns,
            options.to,
            options.markers,
            options.curve,
            progress=fitting,
            **weight,
        )
    with writing(options.out):
        files = found.write(options.out, options.command)
    screen = console(options)
    screen.print(found.calibration.headline, soft_wrap=True)
    screen.print(calibration_table(f"{study.stem}: springs fitted to {found.reference}", found.calibration))
    parameters = found.calibration.unknowns.sentence(found.calibration.values)
    if parameters:
        screen.print(parameters, soft_wrap=True)
    screen.print(found.calibration.identifiability.sentence, soft_wrap=True)
    for text in found.calibration.warnings:
        screen.print(f"warning: {text}", soft_wrap=True)
    screen.print(f"study: {files['calibrated.toml']}", soft_wrap=True)
    print_file(options, "report", files["report.html"])
    if options.json:
        print_json(found.values)
    if not found.calibration.converged:
        for text in found.calibration.warnings:
            say(f"{study.stem}: {text}")
    return CONVERGED if found.calibration.converged else NOT_CONVERGED


CALIBRATE = Verb(
    "calibrate",
    "fit the springs of a study to a reference, and test them on other loads",
    _add,
    _run,
    (
        "truespring calibrate strip.toml",
        "truespring calibrate strip.toml --to linear --unknowns direction-row",
    ),
)
