"""The verb `export`: write springs for another simulator."""

import argparse
from typing import Any

from truespring.cli.names import TARGETS
from truespring.cli.printing import console, print_each, progress, reserve, say, show, writing
from truespring.cli.verb import CONVERGED, NOT_CONVERGED, Verb, add_out, add_studies, one_of


def _add(parser: argparse.ArgumentParser) -> None:
    add_studies(parser)
    parser.add_argument(
        "--to",
        action="append",
        required=True,
        metavar="TARGET",
        **one_of(TARGETS, "truespring.targets"),
        help=f"{', '.join(TARGETS)}; repeat for several targets",
    )
    parser.add_argument(
        "--model",
        metavar="NAME",
        help="springs model to export, default: the compared model if it is one, else the first",
    )
    parser.add_argument(
        "--option",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="option of a target, or TARGET.KEY=VALUE for one of several; repeat for several options",
    )
    add_out(parser)


def _run(options: argparse.Namespace) -> int:
    from truespring.exports import read_options
    from truespring.study import export_study, read_studies, refused_targets, springs_of

    chosen = read_options(options.option)
    studies = read_studies(options.study)
    refused: dict[str, str] = {}
    for study in studies:  # raise errors before any study is solved
        name = springs_of(study, options.to, options.model, chosen)
        refused |= {f"{study.stem}/{to}": why for to, why in refused_targets(study, options.to, name).items()}
    for why in refused.values():
        say(f"not written: {why}")
    reserve(options, studies)
    screen = console(options)
    values: dict[str, Any] = {}
    converged = not refused
    for study in studies:
        with progress(options) as advance, writing(options.out):
            written = export_study(study, options.to, options.out, options.model, advance, chosen)
        for one in written:
            if options.quiet and not options.json:
                show(*one.files)
            screen.print(f"{study.stem}: {one.target}: {', '.join(map(str, one.files))}", soft_wrap=True)
        screen.print("\n".join(written[0].sentences), soft_wrap=True)
        if not written[0].converged:
            converged = False
            say(f"{study.stem}: {written[0].fault}")
        found = {one.target: one.values for one in written}
        values[study.stem] = found if len(found) > 1 else written[0].values
    if options.json:
        print_each(values)
    return CONVERGED if converged else NOT_CONVERGED


EXPORT = Verb(
    "export",
    "write springs for another simulator, with the displacement to expect there",
    _add,
    _run,
    (
        "truespring export strip.toml --to mujoco",
        "truespring export strip.toml --to calculix --to npz --model springs",
    ),
)
