"""The verb `compare`: compare results of any programs."""

import argparse

from truespring.cli.names import READERS
from truespring.cli.printing import console, print_each, print_file, progress, reserve, writing
from truespring.cli.solve import print_failures
from truespring.cli.verb import CONVERGED, NOT_CONVERGED, Verb, add_out, add_timeout, relative_error

#: Options that state what a result file does not, each for all files or, as FILE=VALUE, for one.
FILE_OPTIONS = {
    "unit": "length unit of a file, default: m",
    "axes": "axes of a file along those of the first: x,z,-y has its z along our y, and our z against its y",
    "shift": "vector added to the positions of a file: 0,0,5 mm",
    "load_factor": "load level of a file that has one level, default: 1",
    "full_time": "time of full load in a file, default: 1, or its last time where that is later",
    "force_unit": "force unit of a .dat file; without it, its energies are left out",
    "field": "name of the displacement in a VTK file",
    "undeformed": "undeformed body, for STL and marker files that hold only the deformed one",
    "mesh": "deck with the nodes of a .dat file, default: the .inp file of the same name",
}


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "source",
        nargs="+",
        help="study, or folder that truespring wrote, with :MODEL for another than the compared model; or a result: "
        f"{', '.join(READERS)}",
    )
    add_out(parser)
    add_timeout(parser)
    parser.add_argument(
        "--probe",
        metavar="POINT",
        help='such as right-middle or "160 mm, 20 mm", default: the node that moves most',
    )
    parser.add_argument(
        "--tolerance",
        type=relative_error,
        metavar="E",
        help="largest error (rms or force) at which two results agree, default: 0.05",
    )
    for name, what in FILE_OPTIONS.items():
        parser.add_argument(
            f"--{name.replace('_', '-')}", action="append", default=[], metavar="[FILE=]VALUE", help=what
        )


def _run(options: argparse.Namespace) -> int:
    from truespring.comparing import compare_sources, find_sources, read_probe
    from truespring.comparing.tables import difference_tables

    given = [(name, getattr(options, name)) for name in FILE_OPTIONS]
    sources = find_sources(options.source, given)
    probe = read_probe(options.probe)
    reserve(options)
    with progress(options) as advance:
        reading = None if advance is None else lambda text, share: advance("reading", text, share)
        found = compare_sources(sources, probe, options.tolerance, reading, options.timeout)
    with writing(options.out):
        files = found.write(options.out, options.command)
    screen = console(options)
    for result in found:
        for part in difference_tables(result):
            screen.print(part)
    print_file(options, "report", files["report.html"])
    if options.json:
        print_each(found.values)
    for result in found:
        print_failures(result, options.out, shown=not screen.quiet)
    return CONVERGED if found.converged else NOT_CONVERGED


COMPARE = Verb(
    "compare",
    "compare results of any programs; the first one is the reference",
    _add,
    _run,
    (
        "truespring compare strip.toml:neo-hookean strip.toml:springs",
        "truespring compare job.frd strip.toml --unit job.frd=mm --probe right-middle",
    ),
)
