"""The verb `sweep`: solve a study with many values of its keys."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from truespring.cli.printing import console, counting, print_file, print_json, reserve, say, writing
from truespring.cli.verb import CONVERGED, NOT_CONVERGED, Verb, add_out, add_timeout, add_workers, positive
from truespring.errors import TruespringError


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", help="study file (TOML)")
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help='"material.young=4 kPa,8 kPa", "mesh.elements=[8,2],[16,4]", "material.poisson=0:0.45:10"; lists count '
        "from 1, as in load.1.force; repeat for all combinations",
    )
    parser.add_argument(
        "--lhs", type=positive, metavar="N", help="sample N points of a Latin hypercube instead of all combinations"
    )
    parser.add_argument("--seed", type=int, metavar="S", help="seed of the Latin hypercube, default: 0")
    parser.add_argument(
        "--points",
        type=Path,
        metavar="FILE",
        help="CSV file of points instead of --vary: a header line of keys, then one row per point",
    )
    parser.add_argument("--retry-failed", action="store_true", help="solve points again that failed in an earlier run")
    add_workers(parser, "all cores")
    add_timeout(parser)
    add_out(parser, "out/sweep")


def _run(options: argparse.Namespace) -> int:
    from truespring.sweeping import plan_sweep, read_vary, run_sweep, write_sweep
    from truespring.sweeping.page import sweep_table

    vary = dict[str, Any]()
    for key, values in map(read_vary, options.vary):
        if key in vary:
            raise TruespringError(f"--vary {key} is given twice: give all its values in one option")
        vary[key] = values
    if options.seed is not None and options.lhs is None:
        raise TruespringError(f"--seed {options.seed} is for a Latin hypercube: add --lhs N, or leave --seed out")
    plan = plan_sweep(options.study, vary, options.lhs, options.seed or 0, options.points)
    reserve(options)
    screen = console(options)
    try:
        with counting(options, "points") as (advance, note), writing(options.out):
            done = run_sweep(
                plan,
                options.out,
                options.workers,
                options.scheduler,
                threads=options.threads or 1,
                retry_failed=options.retry_failed,
                timeout=options.timeout,
                progress=advance,
                note=note,
            )
    except KeyboardInterrupt:
        say("interrupted; the same command continues where it stopped")
        raise
    with writing(options.out):
        table = write_sweep(done, options.out, options.command)
    screen.print(sweep_table(plan.keys, done.rows))
    screen.print(f"table: {table}", soft_wrap=True)
    print_file(options, "report", options.out / "report.html")
    if options.json:
        counts = {"n_points": len(done.rows), "n_failed": done.n_failed, "n_before": done.n_before}
        print_json({**counts, "table": str(table), "rows": done.rows})
    if not done.converged:
        _print_failed(done.rows, plan.keys)
    return CONVERGED if done.converged else NOT_CONVERGED


def _print_failed(rows: Sequence[dict[str, Any]], keys: Sequence[str], most: int = 10) -> None:
    """Print on standard error the first `most` failed points with their reasons."""
    failed = [row for row in rows if row["status"] == "failed"]
    for row in failed[:most]:
        say(f"{', '.join(f'{key} = {row[key]}' for key in keys)}: {row['reason']}")
    if len(failed) > most:
        say(f"and {len(failed) - most} more points failed: the table lists all reasons")


SWEEP = Verb(
    "sweep",
    "solve a study with many values of its keys, on all cores or a cluster",
    _add,
    _run,
    (
        'truespring sweep strip.toml --vary "material.poisson=0:0.45:10"',
        'truespring sweep strip.toml --vary "material.young=4 kPa,8 kPa" --vary "mesh.elements=[8,2],[16,4]"',
    ),
    threads="threads of the linear algebra of each worker, default: 1",
)
