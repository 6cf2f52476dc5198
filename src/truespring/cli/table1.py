"""The verb `table1`: measure Table 1 of the paper."""

import argparse

from truespring.cli.printing import print_file, print_json, progress, reserve, writing
from truespring.cli.verb import CONVERGED, Verb, add_out


def _add(parser: argparse.ArgumentParser) -> None:
    add_out(parser)
    parser.add_argument("--dim", type=int, choices=(2, 3), help="dimension of the bodies, default: both")


def _run(options: argparse.Namespace) -> int:
    from truespring.table1 import measure_table, write_table

    reserve(options)
    dims = (2, 3) if options.dim is None else (options.dim,)
    with progress(options) as advance:
        measuring = None if advance is None else lambda what, share: advance("table1", what, share)
        table = measure_table(dims, progress=measuring)
    with writing(options.out):
        page = write_table(table, options.out)
    print_file(options, "table", page)
    if options.json:
        print_json(table)
    return CONVERGED


TABLE1 = Verb(
    "table1",
    "for readers of the paper: measure its Table 1, the plus and minus signs of six methods",
    _add,
    _run,
    ("truespring table1", "truespring table1 --dim 2 --out table1"),
)
