"""The command line: parses, calls, prints; nothing else."""

import argparse
import gc
import importlib
import io
import json
import math
import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truespring.errors import TruespringError, one_line

if TYPE_CHECKING:
    from rich.console import Console

    from truespring.converging import Refinement
    from truespring.equilibrium import Solution
    from truespring.outputs import Output
    from truespring.report.result import Result
    from truespring.study import Known, Realised, Study

CONVERGED, NOT_CONVERGED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 converged, 1 not, 2 the input is wrong."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed before the command began: what is opened next would take its place
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):  # what a terminal cannot show is no reason to stop
            stream.reconfigure(errors="backslashreplace")
    try:
        code = _run_verb(arguments)
    except SystemExit as end:  # of the parser, which has said why
        return _said(end.code if isinstance(end.code, int) else WRONG_INPUT, end)
    return _said(code)


def _said(code: int, end: SystemExit | None = None) -> int:
    """Return the exit code, but 1 for 0 where standard output did not take all that was said; raise `end`, if any."""
    try:
        sys.stdout.flush()
    except OSError as error:
        unsaid = _unsaid(error)
        return code or unsaid
    if end is not None:
        raise end
    return code


def _unsaid(error: OSError) -> int:
    """Say that standard output cannot be written, and throw away what is left, which Python would write at its end."""
    _say(f"standard output cannot be written: {error.strerror}")
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
    return NOT_CONVERGED


def _say(text: str) -> None:
    """Say something on standard error, if that can be."""
    with suppress(OSError):
        print(f"truespring: {text}", file=sys.stderr, flush=True)


def _run_verb(arguments: Sequence[str] | None) -> int:
    options = _parser().parse_args(arguments)
    try:
        _load()
        with _threads(options.threads), ExitStack() as options.reserved:
            code: int = options.verb(options)
            return code
    except TruespringError as error:
        for line in str(error).splitlines():
            _say(line)
        return WRONG_INPUT
    except MemoryError:
        _say("out of memory: take fewer elements")
        return NOT_CONVERGED
    except KeyboardInterrupt:
        return INTERRUPTED
    except OSError as error:
        if error.filename is None:  # no file of ours: those are named
            return _unsaid(error)
        _say(f"{error.filename}: {error.strerror}")
        return NOT_CONVERGED
    except Exception as error:
        if sys.flags.dev_mode:  # python -X dev shows where
            raise
        told = f"{type(error).__name__}: {one_line(str(error))}"
        _say(f"internal error, please report it with the study: {told}")
        return NOT_CONVERGED


def _load() -> None:
    """Import what every verb needs, while the garbage collector rests, and have it pass over all of that later.

    What modules hold is there to stay; to look through it again and again took a tenth of the time of a small study.
    """
    if "truespring.study" in sys.modules:  # this process does more than one command: its memory is its own affair
        return
    gc.disable()
    try:
        importlib.import_module("truespring.study")
    finally:
        gc.freeze()
        gc.enable()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="truespring",
        description="Mass-spring bodies true to their material, solved at large deformation, shown beside FEM.",
    )
    parser.add_argument("--version", action="version", version=f"truespring {version('truespring')}")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--json", action="store_true", help="print one JSON object on standard output, nothing else")
    common.add_argument("--quiet", action="store_true", help="no progress and no tables; errors are still said")
    common.add_argument("--threads", type=_positive, metavar="N", help="threads of the linear algebra (default: all)")
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB")

    def add(name: str, run: Callable[[argparse.Namespace], int], summary: str, studies: bool = True) -> Any:
        verb = verbs.add_parser(name, parents=[common], help=summary, description=summary)
        verb.set_defaults(verb=run)
        if studies:
            verb.add_argument("study", nargs="+", help="a study file (TOML)")
        return verb

    for name, run, summary in (
        ("verify", _verify, "solve every model of a study, compare them, write curves, pictures and a report"),
        ("solve", _solve, "the same without comparison, figures and report"),
        ("moduli", _moduli, "tell and draw what the springs of a study realise, and which rule is better, unsolved"),
    ):
        verb = add(name, run, summary)
        verb.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="default: out")
        if name != "moduli":
            _add_timeout(verb)
    verb = add("converge", _converge, "solve a study on finer and finer meshes until what is watched settles")
    verb.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="default: out")
    verb.add_argument(
        "--tolerance", type=float, default=0.01, metavar="E", help="relative error to reach, default: 0.01"
    )
    verb.add_argument("--meshes", type=_positive, default=5, metavar="N", help="largest number of meshes, default: 5")
    verb = add("compare", _compare, "compare results, whoever computed them: the first is the reference", studies=False)
    _add_sources(verb)
    verb = add("export", _export, "write the springs of a study for another simulator, and what to expect there")
    verb.add_argument(
        "--to",
        action="append",
        required=True,
        metavar="TARGET",
        help="calculix, abaqus, mujoco, sofa, npz or json; may be given again",
    )
    verb.add_argument("--model", metavar="NAME", help="default: the compared model, or the first springs")
    verb.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="default: out")
    _add_sweep(add("sweep", _sweep, "solve a study with many values of its keys, on all cores or a cluster", False))
    _add_calibrate(
        add("calibrate", _calibrate, "fit the springs of a study to a reference, test them on other loads", False)
    )
    _add_map(add("map", _map, "map up to which load and on which meshes springs are near FEM", False))
    add("check", _check, "check a study and show what would be run, solving nothing")
    verb = add(
        "table1", _table1, "measure the paper's Table 1: six methods on one body, beside its signs", studies=False
    )
    verb.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="default: out")
    verb.add_argument("--dim", type=int, choices=(2, 3), help="in the plane or in space only; default: both")
    add("rules", _rules, "list the stiffness rules: what they realise, and their source", studies=False)
    add("schema", _schema, "print the JSON Schema of a study file", studies=False)
    return parser


def _add_timeout(verb: argparse.ArgumentParser) -> None:
    verb.add_argument(
        "--timeout",
        type=_seconds,
        metavar="SECONDS",
        help="stop a model after this time; default: no limit, 3600 for other programs",
    )


def _add_sweep(verb: argparse.ArgumentParser) -> None:
    """What is varied, who solves it, and where it is kept."""
    verb.add_argument("study", help="a study file (TOML)")
    verb.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help='"material.young=4 kPa,8 kPa", "mesh.elements=[8,2],[16,4]", "material.poisson=0:0.45:10"; lists count '
        "from 1: load.1.force; may be given again: all combinations",
    )
    verb.add_argument("--lhs", type=_positive, metavar="N", help="instead N points of a Latin hypercube over them")
    verb.add_argument("--seed", type=int, default=0, metavar="S", help="of the Latin hypercube, default: 0")
    verb.add_argument("--points", type=Path, metavar="FILE", help="instead a CSV file: keys first, then a row a point")
    verb.add_argument("--workers", type=_positive, metavar="N", help="processes on this machine, default: all cores")
    verb.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster to take instead: tcp://10.0.0.1:8786")
    verb.add_argument("--retry-failed", action="store_true", help="try points again that have failed before")
    _add_timeout(verb)
    verb.add_argument("--out", type=Path, default=Path("out/sweep"), metavar="DIR", help="default: out/sweep")


def _add_calibrate(verb: argparse.ArgumentParser) -> None:
    """What `calibrate` takes."""
    verb.add_argument("study", help="the study whose springs are fitted, under its load")
    verb.add_argument("case", nargs="*", help="further studies of the same body, whose loads are fitted too")
    verb.add_argument("--held-out", nargs="+", default=[], metavar="CASE", help="studies whose loads only test")
    verb.add_argument("--unknowns", default="class", metavar="KIND", help="class, region, direction-row or spring")
    verb.add_argument("--to", metavar="NAME", help="the reference in the studies; default: neo-Hookean FEM, if there")
    verb.add_argument("--markers", type=Path, metavar="FILE", help="markers (.csv) measured under the study's load")
    verb.add_argument("--curve", type=Path, metavar="FILE", help="a force-displacement curve (.csv) likewise")
    verb.add_argument(
        "--regularisation", type=float, metavar="R", help="weight of the pull toward the rule, default: 0.01"
    )
    verb.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="default: out")


def _add_map(verb: argparse.ArgumentParser) -> None:
    """What is mapped, along what, and who solves it."""
    verb.add_argument("study", help="a study file (TOML)")
    verb.add_argument("--law", default="neo-hookean", metavar="L", help="of the reference, default: neo-hookean")
    verb.add_argument(
        "--load",
        action="append",
        metavar="TYPE",
        help="own (the study's), stretch, compress, bend, shear, twist (in space) or all; may be given again; "
        "default: own",
    )
    verb.add_argument(
        "--rule",
        action="append",
        metavar="R",
        help="a springs model of the study, a rule, RULE+volume, or all that are for its mesh; may be given again; "
        "default: the springs of the study, all rules where it has none",
    )
    verb.add_argument("--x", default="load", metavar="A", help="load (default), depth, aspect or poisson")
    verb.add_argument(
        "--y", metavar="B", help="another of them, rule, load-type or none; default: depth, if x is the load"
    )
    verb.add_argument(
        "--range",
        action="append",
        default=[],
        metavar="A=FIRST:LAST[:COUNT]",
        help="of an axis: depth=1:8, load=0:0.4 (a strain, a share of the length, an angle), poisson=0:0.45:16 (in so "
        "many intervals at the finest); may be given again",
    )
    verb.add_argument("--whole", action="store_true", help="solve the whole grid, not only where lines pass")
    verb.add_argument("--workers", type=_positive, metavar="N", help="processes on this machine, default: this one")
    verb.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster to take instead: tcp://10.0.0.1:8786")
    verb.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="default: out")


def _add_sources(verb: argparse.ArgumentParser) -> None:
    """What `compare` takes, and what is told of a file that it does not tell itself."""
    verb.add_argument(
        "source",
        nargs="+",
        help="a study or a folder that truespring wrote, with :MODEL for another than the compared one; or a result: "
        ".frd, .dat, .rst, .vtu, .pvd, .stl, .csv of markers",
    )
    verb.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="default: out")
    _add_timeout(verb)
    verb.add_argument(
        "--probe", metavar="POINT", help='such as right-middle or "160 mm, 20 mm"; default: what moves most'
    )
    verb.add_argument(
        "--tolerance", type=float, metavar="E", help="largest error (rms or force) at which they agree, default: 0.05"
    )
    for name, what in _TOLD.items():
        verb.add_argument(f"--{name.replace('_', '-')}", action="append", default=[], metavar="[FILE=]VALUE", help=what)


_TOLD = {
    "unit": "the unit of length of a file, or of all; default: m",
    "axes": "a file's axes along ours: x,z,-y has its z along our y, and our z against its y",
    "shift": "what is added to a file's places: 0,0,5 mm",
    "load_factor": "the load level of a file of one level; default: 1",
    "full_time": "a file's time of full load; default: 1, or its last time where that is later",
    "force_unit": "the unit of force of a .dat file, without which its energies are left out",
    "field": "the name of the displacement in a VTK file",
    "undeformed": "the body at rest, of STL or marker files that hold the deformed one only",
    "mesh": "the deck with the nodes of a .dat file; default: the .inp of its name",
}


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{number} is not a positive number")
    return number


def _seconds(text: str) -> float:
    seconds = float(text)
    if not 0 < seconds < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number of seconds")
    return seconds


@contextmanager
def _threads(limit: int | None) -> Iterator[None]:
    with ExitStack() as stack:
        if limit is not None:
            from threadpoolctl import threadpool_limits

            from truespring.kernels.threads import set_threads

            stack.enter_context(threadpool_limits(limit))
            stack.callback(set_threads, None)
            set_threads(limit)
        yield


def _verify(options: argparse.Namespace) -> int:
    return _run(options, comparing=True)


def _solve(options: argparse.Namespace) -> int:
    return _run(options, comparing=False)


def _run(options: argparse.Namespace, comparing: bool) -> int:
    from truespring.report.summary import summary
    from truespring.report.tables import result_tables
    from truespring.study import read_studies, realised_moduli, run, verify_command, write_overview, write_rest

    studies = read_studies(options.study)
    _reserve(options, studies)
    console = _console(options)
    results = []
    for study in studies:
        if not console.quiet:
            _print_realised(console, study.stem, realised_moduli(study))
        with _output(study, options.out) as (output, known):
            with _progress(options) as progress:
                result = run(study, progress, comparing, options.timeout, known)
            results.append(result)
            with _writing(options.out):
                (options.out / "report.html").unlink(missing_ok=True)  # it is over what was there before
                write_rest(result, output, verify_command([result], options.out) if comparing else None)
        for part in result_tables(result):
            console.print(part)
    if comparing:
        with _writing(options.out):
            write_overview(results, options.out)
        console.print(f"report: {options.out / 'report.html'}", soft_wrap=True)
    if options.json:
        summaries = {result.stem: summary(result) for result in results}
        _print_json(summaries if len(results) > 1 else summaries[results[0].stem])
    for result in results:
        _say_failures(result, options.out, shown=not console.quiet)
    return CONVERGED if all(result.converged for result in results) else NOT_CONVERGED


@contextmanager
def _output(study: "Study", out: Path) -> "Iterator[tuple[Output, Known]]":
    """The output of a study, and what writes each model's own results to it."""
    from truespring.study import output, write_model

    with _writing(out):
        opened = output(study, out)

    def known(name: str, path: "Solution") -> None:
        with _writing(out):
            write_model(path, opened, name)

    with opened:
        yield opened, known


def _reserve(options: argparse.Namespace, studies: "Sequence[Study]" = ()) -> None:
    """Keep other runs out of the folders of studies, or of --out itself, until the command ends.

    Where nothing can be written, or another run writes, it is said before anything is solved.
    """
    from truespring.outputs import Lock

    with _writing(options.out):
        for folder in [options.out / study.stem for study in studies] or [options.out]:
            options.reserved.enter_context(Lock(folder))


@contextmanager
def _writing(out: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        place = error.filename or out
        raise TruespringError(f"--out {out}: {place} cannot be written: {error.strerror}") from None


def _say_failures(result: "Result", out: Path, shown: bool) -> None:
    """Name on standard error what did not converge and, unless `shown` already, why and what to try."""
    for name, path in result.paths.items():
        if str(path.status) not in ("converged", "read"):
            print(
                f"truespring: {result.stem}: model '{name}' is {path.status}; "
                f"reached load factor {path.load_factor:.6g}, written to {out / result.stem}",
                *(f"truespring:   {warning}" for warning in path.warnings if not shown),
                sep="\n",
                file=sys.stderr,
            )


def _moduli(options: argparse.Namespace) -> int:
    from truespring.study import read_studies, realised_moduli, realised_values, write_moduli

    studies = read_studies(options.study)
    _reserve(options, studies)
    console = _console(options)
    values = {}
    for study in studies:
        found = list(realised_moduli(study))
        values[study.stem] = {one.name: realised_values(one) for one in found}
        _print_realised(console, study.stem, found)
        with _writing(options.out):
            picture = write_moduli(study, found, options.out)
        console.print(f"picture: {picture}" if picture else f"{study.stem}: no model of springs", soft_wrap=True)
    if options.json:
        _print_json(values if len(values) > 1 else values[studies[0].stem])
    return CONVERGED


def _converge(options: argparse.Namespace) -> int:
    from truespring.converging import converge, write_settling
    from truespring.converging.page import settling_table
    from truespring.study import read_studies

    studies = read_studies(options.study)
    if not 0 < options.tolerance < 1:
        raise TruespringError(f"--tolerance {options.tolerance:g}: a relative error between 0 and 1 is wanted")
    _reserve(options, studies)
    console = _console(options)
    found: dict[str, Refinement] = {}
    told_of = [(f"--{name}", str(getattr(options, name))) for name in ("tolerance", "meshes", "out")]
    command = shlex.join(["truespring", "converge", *options.study, *(part for pair in told_of for part in pair)])
    for study in studies:
        for told in converge(study, options.tolerance, options.meshes):
            found[study.stem] = told
            with _writing(options.out):
                page = write_settling(study.title, study.file, told, options.out / study.stem, command)
            console.print(settling_table(f"{study.stem}: {told.n_nodes[-1]:,} nodes", told))
        console.print(found[study.stem].sentence, f"report: {page}", sep="\n", soft_wrap=True)
    if options.json:
        values = {stem: [asdict(one) for one in told.quantities] for stem, told in found.items()}
        _print_json(values if len(values) > 1 else values[studies[0].stem])
    for stem, told in found.items():
        if not told.settled and console.quiet:
            print(f"truespring: {stem}: {told.sentence}", file=sys.stderr)
    return CONVERGED if all(told.settled for told in found.values()) else NOT_CONVERGED


def _compare(options: argparse.Namespace) -> int:
    from truespring.comparing import compare_sources, find_sources, read_probe, write_comparisons
    from truespring.comparing.tables import difference_tables
    from truespring.report.summary import difference

    told = [(name, getattr(options, name)) for name in _TOLD]
    sources = find_sources(options.source, told)
    probe = read_probe(options.probe)
    if options.tolerance is not None and not 0 < options.tolerance < 1:
        raise TruespringError(f"--tolerance {options.tolerance:g}: a relative error between 0 and 1 is wanted")
    _reserve(options)
    with _progress(options) as progress:
        advance = None if progress is None else lambda text, share: progress("reading", text, share)
        results = list(compare_sources(sources, probe, options.tolerance, advance, options.timeout))
    with _writing(options.out):
        report = write_comparisons(results, options.out, options.source, told)
    console = _console(options)
    for result in results:
        for part in difference_tables(result):
            console.print(part)
    console.print(f"report: {report}", soft_wrap=True)
    if options.json:
        values = [difference(result) for result in results]
        _print_json({one["model"]: one for one in values} if len(values) > 1 else values[0])
    for result in results:
        _say_failures(result, options.out, shown=not console.quiet)
    return CONVERGED if all(result.converged for result in results) else NOT_CONVERGED


def _export(options: argparse.Namespace) -> int:
    from truespring.study import export_study, read_studies, springs_of

    studies = read_studies(options.study)
    for study in studies:  # what is wrong is said before any is solved
        springs_of(study, options.to, options.model)
    _reserve(options, studies)
    console = _console(options)
    values: dict[str, Any] = {}
    converged = True
    for study in studies:
        with _progress(options) as progress, _writing(options.out):
            carried = export_study(study, options.to, options.out, options.model, progress)
        for one in carried:
            console.print(f"{study.stem}: {one.target}: {', '.join(map(str, one.files))}", soft_wrap=True)
        console.print("\n".join(carried[0].told), soft_wrap=True)
        if not carried[0].converged:
            converged = False
            print(f"truespring: {study.stem}: {carried[0].fault}", file=sys.stderr)
        found = {one.target: one.values for one in carried}
        values[study.stem] = found if len(found) > 1 else carried[0].values
    if options.json:
        _print_json(values if len(values) > 1 else values[studies[0].stem])
    return CONVERGED if converged else NOT_CONVERGED


def _sweep(options: argparse.Namespace) -> int:
    from truespring.sweeping import plan_sweep, read_vary, run_sweep, write_sweep
    from truespring.sweeping.page import sweep_table

    vary = dict[str, Any]()
    for key, values in map(read_vary, options.vary):
        if key in vary:
            raise TruespringError(f"--vary {key}: is given twice: give all of its values at once")
        vary[key] = values
    plan = plan_sweep(options.study, vary, options.lhs, options.seed, options.points)
    _reserve(options)
    console = _console(options)
    try:
        with _counting(options, "points") as (advance, say), _writing(options.out):
            done = run_sweep(
                plan,
                options.out,
                options.workers,
                options.scheduler,
                threads=options.threads or 1,
                retry_failed=options.retry_failed,
                timeout=options.timeout,
                progress=advance,
                report=say,
            )
    except KeyboardInterrupt:
        print("truespring: interrupted; the same command goes on where it stopped", file=sys.stderr)
        raise
    with _writing(options.out):
        table = write_sweep(done, options.out, _as_typed(options))
    console.print(sweep_table(plan.keys, done.rows))
    console.print(f"table: {table}\nreport: {options.out / 'report.html'}", soft_wrap=True)
    if options.json:
        counts = {"n_points": len(done.rows), "n_failed": done.n_failed, "n_before": done.n_before}
        _print_json({**counts, "table": str(table), "rows": done.rows})
    if not done.converged:
        _say_failed_points(done.rows, plan.keys)
    return CONVERGED if done.converged else NOT_CONVERGED


def _as_typed(options: argparse.Namespace) -> str:
    """The command line that does the same."""
    told = ["truespring", "sweep", options.study]
    for name in ("vary", "lhs", "seed", "points", "workers", "scheduler", "threads", "timeout", "out"):
        value = getattr(options, name)
        for one in value if isinstance(value, list) else [value]:
            if one is not None and (name != "seed" or options.lhs):
                told += [f"--{name}", str(one)]
    return shlex.join(told)


def _say_failed_points(rows: "Sequence[dict[str, Any]]", keys: Sequence[str], most: int = 10) -> None:
    failed = [row for row in rows if row["status"] == "failed"]
    for row in failed[:most]:
        print(f"truespring: {', '.join(f'{key} = {row[key]}' for key in keys)}: {row['reason']}", file=sys.stderr)
    if len(failed) > most:
        print(f"truespring: and {len(failed) - most} more points failed: the table has all reasons", file=sys.stderr)


def _calibrate(options: argparse.Namespace) -> int:
    from truespring.calibration.page import calibration_table
    from truespring.calibration.study import calibrate_study
    from truespring.calibration.writing import calibrated_values, write_calibrated
    from truespring.study import read_studies

    study, *others = read_studies([options.study, *options.case, *options.held_out])
    cases, held_out = others[: len(options.case)], others[len(options.case) :]
    _reserve(options, [study])
    weight = {} if options.regularisation is None else {"regularisation": options.regularisation}
    with _progress(options) as progress:
        advance = None if progress is None else lambda text, share: progress(study.stem, "calibration", share)
        found = calibrate_study(
            study,
            cases,
            held_out,
            options.unknowns,
            options.to,
            options.markers,
            options.curve,
            progress=advance,
            **weight,
        )
    told = ["truespring", "calibrate", options.study, *options.case, "--unknowns", options.unknowns]
    for name in ("to", "markers", "curve", "regularisation"):
        value = getattr(options, name)
        told += [] if value is None else [f"--{name}", str(value)]
    told += ["--out", str(options.out), *(["--held-out", *options.held_out] if options.held_out else [])]
    with _writing(options.out):
        files = write_calibrated(found, options.out, shlex.join(told))
    console = _console(options)
    console.print(calibration_table(f"{study.stem}: springs fitted to {found.reference}", found.calibration))
    console.print(found.calibration.headline, found.calibration.identifiability.sentence, sep="\n", soft_wrap=True)
    for text in found.calibration.warnings:
        console.print(f"warning: {text}", soft_wrap=True)
    console.print(f"study: {files[0]}\nreport: {files[-1]}", soft_wrap=True)
    if options.json:
        _print_json(calibrated_values(found))
    if not found.calibration.converged:
        for text in found.calibration.warnings:
            print(f"truespring: {study.stem}: {text}", file=sys.stderr)
    return CONVERGED if found.calibration.converged else NOT_CONVERGED


def _map(options: argparse.Namespace) -> int:
    from truespring.study import read_studies
    from truespring.validity import map_validity, read_range, validity_values, write_validity

    (study,) = read_studies([options.study])
    _reserve(options, [study])
    y = options.y or ("depth" if options.x == "load" else "none")
    with _counting(options, "paths") as (advance, _):
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
            progress=None if advance is None else lambda what, done, wanted: advance(done, 0, wanted),
        )
    with _writing(options.out):
        files = write_validity(found, options.out, _map_as_typed(options))
    console = _console(options)
    for sentence in found.verdicts:
        console.print(f"{sentence}\n", soft_wrap=True)
    console.print(f"report: {files['report.html']}", soft_wrap=True)
    if options.json:
        _print_json(validity_values(found))
    return CONVERGED if found.converged else NOT_CONVERGED


def _map_as_typed(options: argparse.Namespace) -> str:
    """The command line that does the same."""
    told = ["truespring", "map", options.study]
    for name in ("law", "load", "rule", "x", "y", "range", "workers", "scheduler", "out"):
        value = getattr(options, name)
        for one in value if isinstance(value, list) else [value]:
            if one is not None and (name, one) not in (("law", "neo-hookean"), ("x", "load")):
                told += [f"--{name}", str(one)]
    return shlex.join(told + (["--whole"] if options.whole else []))


def _print_realised(console: "Console", stem: str, several: "Iterable[Realised]") -> None:
    """What springs realise beside each material, and whether they are fit for all of them."""
    from truespring.report.tables import moduli_table

    for one in several:
        for title, (_, moduli) in zip(one.titles, one.by_material, strict=True):
            console.print(moduli_table(f"{stem}: {title}", moduli))
        console.print(f"{one.fitness.sentence}\n")


def _rules(options: argparse.Namespace) -> int:
    from truespring.report.tables import rules_table
    from truespring.study import rule_values

    rules = rule_values()
    _console(options).print(rules_table(rules))
    if options.json:
        _print_json(rules)
    return CONVERGED


def _table1(options: argparse.Namespace) -> int:
    from truespring.table1 import measure_table, write_table

    _reserve(options)
    dims = (2, 3) if options.dim is None else (options.dim,)
    with _progress(options) as progress:
        advance = None if progress is None else lambda what, share: progress("table1", what, share)
        table = measure_table(dims, progress=advance)
    with _writing(options.out):
        page = write_table(table, options.out)
    _console(options).print(f"table: {page}", soft_wrap=True)
    if options.json:
        _print_json(table)
    return CONVERGED


def _check(options: argparse.Namespace) -> int:
    from truespring.study import plan, read_studies, realised_moduli

    studies = read_studies(options.study)
    plans = {study.stem: plan(study) for study in studies}
    console = _console(options)
    for study in studies:
        _print_plan(console, plans[study.stem])
        if not console.quiet:
            _print_realised(console, study.stem, realised_moduli(study))
    if options.json:
        _print_json(plans if len(plans) > 1 else plans[studies[0].stem])
    return CONVERGED


def _schema(options: argparse.Namespace) -> int:
    from truespring.study.schema import StudyTable

    _print_json(StudyTable.model_json_schema())
    return CONVERGED


def _print_json(value: Any) -> None:
    print(json.dumps(value, indent=2, allow_nan=False))


def _console(options: argparse.Namespace) -> "Console":
    from rich.console import Console

    class Plain(Console):
        """A console that leaves it to `main` to say that its reader has gone."""

        def on_broken_pipe(self) -> None:
            raise  # what is being handled

    return Plain(quiet=options.quiet or options.json, highlight=False, markup=False, emoji=False)


@contextmanager
def _progress(options: argparse.Namespace) -> Iterator[Callable[[str, str, float], None] | None]:
    """A bar a model on standard error, where that is a terminal."""
    if options.quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress, TaskID

    tasks: dict[str, TaskID] = {}
    with Progress(console=Console(stderr=True), transient=True) as bars:

        def advance(study: str, model: str, load_factor: float) -> None:
            if model not in tasks:
                tasks[model] = bars.add_task(f"{study}: {model}", total=1.0)
            bars.update(tasks[model], completed=load_factor)

        yield advance


@contextmanager
def _counting(
    options: argparse.Namespace, what: str
) -> Iterator[tuple[Callable[[int, int, int], None] | None, Callable[[str], None] | None]]:
    """A bar with the time left, on standard error where that is a terminal, and a way to say something above it."""
    if options.quiet:
        yield None, None
        return
    if not sys.stderr.isatty():
        yield None, lambda text: print(f"truespring: {text}", file=sys.stderr)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    console = Console(stderr=True, highlight=False, markup=False, emoji=False)
    with Progress(*columns, TextColumn("left:"), TimeRemainingColumn(), console=console, transient=True) as bars:
        task = bars.add_task(what, total=None)

        def advance(done: int, failed: int, total: int) -> None:
            told = f"{what}, {failed} failed" if failed else what
            bars.update(task, completed=done, total=total, description=told)

        yield advance, lambda text: console.print(f"truespring: {text}", soft_wrap=True)


def _print_plan(console: "Console", plan: dict[str, Any]) -> None:
    held = ", ".join(f"{count} along {axis}" for axis, count in plan["held"].items())
    material, section = plan["material"], plan["section"]
    size = " by ".join(f"{extent:g} m" for extent in plan["size"])
    across = f", {section['kind']}, thickness {section['thickness']:g} m" if section else ""
    console.print(f"{plan['title']}\n{size}{across}")
    if material:
        console.print(f"Young's modulus {material['young']:g} Pa, Poisson's ratio {material['poisson']:g}")
    for region in plan["regions"]:
        console.print(f"  in {region['n_elements']} elements {region['young']:g} Pa and {region['poisson']:g}")
    console.print(f"{plan['n_nodes']} nodes, {plan['n_elements']} elements, {plan['n_unknowns']} unknowns")
    for note in plan["mesh_notes"]:
        console.print(f"the mesh: {note}")
    console.print(f"held nodes: {held}")
    force = ", ".join(f"{component:g}" for component in plan["total_force"])
    motion = f", prescribed motion up to {plan['largest_motion']:g} m" if plan["largest_motion"] else ""
    console.print(f"total force ({force}) N{motion}, in {plan['load_steps']} load steps")
    probe = "the node that moves most" if plan["probe"] is None else f"the node at {plan['probe']} m"
    console.print(f"probe: {probe}")
    for name, model in plan["models"].items():
        console.print(f"  {name}: {model['label']}", *(f"\n    warning: {text}" for text in model.get("warnings", ())))
    compare = plan["compare"]
    console.print(f"compared: {compare['model']} with {', '.join(compare['references']) or 'nothing'}\n")
