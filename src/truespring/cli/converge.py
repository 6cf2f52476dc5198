"""The verb `converge`: solve a study on finer and finer meshes."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from truespring.cli.printing import console, print_each, print_file, reserve, say, writing
from truespring.cli.verb import CONVERGED, NOT_CONVERGED, Verb, add_out, add_studies, positive, relative_error

if TYPE_CHECKING:
    from truespring.converging import StudyRefinement


def _add(parser: argparse.ArgumentParser) -> None:
    add_studies(parser)
    add_out(parser)
    parser.add_argument(
        "--tolerance", type=relative_error, default=0.01, metavar="E", help="relative error to reach, default: 0.01"
    )
    parser.add_argument("--meshes", type=positive, default=5, metavar="N", help="largest number of meshes, default: 5")


def _run(options: argparse.Namespace) -> int:
    from truespring.converging import converge
    from truespring.converging.page import settling_table
    from truespring.study import read_studies

    studies = read_studies(options.study)
    reserve(options, studies)
    screen = console(options)
    found: dict[str, StudyRefinement] = {}
    for study in studies:
        for refinement in converge(study, options.tolerance, options.meshes):
            found[study.stem] = refinement
            with writing(options.out):
                page = refinement.write(options.out, options.command)["converge.html"]
            screen.print(settling_table(f"{study.stem}: {refinement.n_nodes[-1]:,} nodes", refinement))
        screen.print(found[study.stem].sentence, soft_wrap=True)
        print_file(options, "report", page)
    if options.json:
        print_each({stem: [asdict(one) for one in refinement.quantities] for stem, refinement in found.items()})
    for stem, refinement in found.items():
        if not refinement.settled and screen.quiet:
            say(f"{stem}: {refinement.sentence}")
    return CONVERGED if all(refinement.settled for refinement in found.values()) else NOT_CONVERGED


CONVERGE = Verb(
    "converge",
    "solve a study on finer and finer meshes until displacement, force and energy settle",
    _add,
    _run,
    (
        "truespring converge strip.toml",
        "truespring converge strip.toml --tolerance 0.02 --meshes 3",
    ),
)
