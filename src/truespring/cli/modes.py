"""The verb `modes`: natural frequencies and shapes of every model of a study."""

import argparse

from truespring.cli.printing import console, print_each, print_file, progress, reserve, say, writing
from truespring.cli.verb import CONVERGED, NOT_CONVERGED, Verb, add_out, add_studies, positive


def _add(parser: argparse.ArgumentParser) -> None:
    add_studies(parser)
    add_out(parser)
    parser.add_argument(
        "--count", type=positive, default=6, metavar="N", help="number of modes beside rigid-body motions, default: 6"
    )
    parser.add_argument("--animate", action="store_true", help="also write an animation of each mode, mode_N.gif")


def _run(options: argparse.Namespace) -> int:
    from truespring.study import read_studies
    from truespring.vibration import study_modes
    from truespring.vibration.tables import mode_table, rigid_line

    studies = read_studies(options.study, balanced=False)
    reserve(options, studies)
    screen = console(options)
    values, converged = {}, True
    for study in studies:
        with progress(options) as advance:
            found = study_modes(study, options.count, advance)
        with writing(options.out):
            files = found.write(options.out, options.animate)
        screen.print(mode_table(found))
        for text in (rigid_line(found), *(f"warning: {one}" for one in found.warnings)):
            if text:
                screen.print(text, soft_wrap=True)
        print_file(options, "figure", files["figures/modes.png"])
        if screen.quiet and not found.converged:
            for text in found.warnings:
                say(f"{study.stem}: {text}")
        values[study.stem] = found.values
        converged &= found.converged
    if options.json:
        print_each(values)
    return CONVERGED if converged else NOT_CONVERGED


MODES = Verb(
    "modes",
    "show the lowest natural frequencies and shapes of springs and FEM; solves no equilibrium",
    _add,
    _run,
    (
        "truespring modes strip.toml",
        "truespring modes block.toml --count 10 --animate",
    ),
)
