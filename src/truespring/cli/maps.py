"""The verb `map`: map the errors of springs against FEM over load and mesh."""

import argparse

from truespring.cli.names import LAWS, LOAD_TYPES, LOAD_TYPES_3D, RULES, VARIANTS
from truespring.cli.printing import console, counting, print_file, print_json, reserve, writing
from truespring.cli.verb import CONVERGED, NOT_CONVERGED, Verb, add_out, add_workers, one_of


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", help="study file (TOML)")
    parser.add_argument(
        "--law",
        default="neo-hookean",
        metavar="L",
        **one_of(LAWS, "truespring.laws"),
        help=f"law of the reference: {', '.join(LAWS)}; default: neo-hookean",
    )
    parser.add_argument(
        "--load",
        action="append",
        metavar="TYPE",
        **one_of((*LOAD_TYPES, "all")),
        help=f"{', '.join(LOAD_TYPES)} or all ({', '.join(LOAD_TYPES_3D)}: in 3D only; own: the load of the study); "
        "repeat for several; default: own",
    )
    parser.add_argument(
        "--rule",
        action="append",
        metavar="R",
        help=f"springs model of the study, a rule ({', '.join(RULES)}), RULE+VARIANT ({', '.join(VARIANTS)}), "
        "or all, the rules for its mesh; "
        "repeat for several; default: the springs of the study, or all",
    )
    parser.add_argument("--x", default="load", metavar="A", help="load, depth, aspect or poisson; default: load")
    parser.add_argument(
        "--y", metavar="B", help="another axis, rule, load-type or none; default: depth if x is load, else none"
    )
    parser.add_argument(
        "--range",
        action="append",
        default=[],
        metavar="A=FIRST:LAST[:COUNT]",
        help="range of an axis: depth=1:8, load=0:0.4 (a strain, a share of the length, an angle), "
        "poisson=0:0.45:17 (with 17 values on the finest grid); repeat for several",
    )
    parser.add_argument("--whole", action="store_true", help="solve the whole grid, not only near contour lines")
    add_workers(parser, "this one")
    add_out(parser)


def _run(options: argparse.Namespace) -> int:
    from truespring.study import read_studies
    from truespring.validity import map_validity, read_range, validity_values, write_validity

    (study,) = read_studies([options.study])
    reserve(options, [study])
    y = options.y or ("depth" if options.x == "load" else "none")
    with counting(options, "paths") as (advance, _):
        found = map_validity(
            study,
            law=options.law,
            loads=options.load,
            rules=options.rule,
            x=options.x,
            y=None if y == "none" else y,
            ranges=dict(map(read_range, options.range)),
            adaptive=not options.whole,
            workers=None if options.scheduler else options.workers or 1,
            scheduler=options.scheduler,
            threads=options.threads or 1,
            progress=None if advance is None else lambda what, done, total: advance(done, 0, total),
        )
    with writing(options.out):
        files = write_validity(found, options.out, options.command)
    screen = console(options)
    for sentence in found.verdicts:
        screen.print(f"{sentence}\n", soft_wrap=True)
    print_file(options, "report", files["report.html"])
    if options.json:
        print_json(validity_values(found))
    return CONVERGED if found.converged else NOT_CONVERGED


MAP = Verb(
    "map",
    "map up to which load, and on which meshes, springs agree with FEM",
    _add,
    _run,
    (
        "truespring map strip.toml",
        "truespring map strip.toml --load bend --rule isotropic --range depth=1:4",
    ),
    threads="threads of the linear algebra of each worker, default: 1 with --workers above 1 or --scheduler, else all "
    "cores",
)
