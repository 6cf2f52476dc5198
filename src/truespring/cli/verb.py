"""A verb of the command line, its exit codes, and the options that verbs share."""

import argparse
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truespring.errors import nearest

CONVERGED, NOT_CONVERGED, WRONG_INPUT, INTERRUPTED, CLOSED_PIPE = 0, 1, 2, 130, 141


@dataclass(frozen=True)
class Verb:
    """A verb: how it is parsed, described and run.

    Attributes:
        name: what the user types.
        summary: one line for the list of verbs, which also heads the verb's own help.
        add: adds the verb's arguments to its parser; called only where the verb is parsed, so it may import tables.
        run: runs the verb and returns its exit code.
        examples: command lines that end the verb's help; they run in the project's folder, or on what `new` writes.
        common: which of COMMON the verb takes: those that have an effect on it.
    """

    name: str
    summary: str
    add: Callable[[argparse.ArgumentParser], Any]
    run: Callable[[argparse.Namespace], int]
    examples: tuple[str, ...]
    common: tuple[str, ...] = ("json", "quiet", "threads")


def positive(text: str) -> int:
    """Return a whole number of at least 1."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{number} is not a positive number")
    return number


def seconds(text: str) -> float:
    """Return a positive, finite number of seconds."""
    number = float(text)
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number of seconds")
    return number


def relative_error(text: str) -> float:
    """Return a relative error between 0 and 1."""
    number = float(text)
    if not 0 < number < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a relative error between 0 and 1")
    return number


def one_of(names: Iterable[str]) -> dict[str, Any]:
    """Return the arguments of add_argument for an option whose values are `names`; an error names the nearest."""
    allowed = tuple(names)

    def known(text: str) -> str:
        if text not in allowed:
            raise argparse.ArgumentTypeError(
                f"'{text}' is unknown{nearest(text, allowed)}; allowed: {', '.join(allowed)}"
            )
        return text

    return {"type": known, "choices": allowed}


#: Options that several verbs share, by the name of their value.
COMMON: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "json": (("--json",), {"action": "store_true", "help": "print one JSON object on standard output, nothing else"}),
    "quiet": (
        ("-q", "--quiet"),
        {"action": "store_true", "help": "print nothing but errors and the path of the report or file written"},
    ),
    "verbose": (
        ("-v", "--verbose"),
        {"action": "store_true", "help": "print all effective moduli of springs as a table, not in one line"},
    ),
    "threads": (
        ("--threads",),
        {"type": positive, "metavar": "N", "help": "threads of the linear algebra, default: all cores"},
    ),
}


def add_studies(parser: argparse.ArgumentParser) -> None:
    """Add the study files that a verb reads, one or more."""
    parser.add_argument("study", nargs="+", help="study file (TOML)")


def add_out(parser: argparse.ArgumentParser, folder: str = "out") -> None:
    """Add --out, the folder for results."""
    parser.add_argument(
        "--out", type=Path, default=Path(folder), metavar="DIR", help=f"folder for results, default: {folder}"
    )


def add_timeout(parser: argparse.ArgumentParser) -> None:
    """Add --timeout, the time limit of each model."""
    parser.add_argument(
        "--timeout",
        type=seconds,
        metavar="SECONDS",
        help="time limit of each model, and of refining each reference; default: none, 3600 for other programs",
    )


def add_workers(parser: argparse.ArgumentParser, default: str) -> None:
    """Add --workers and --scheduler, which processes solve; one or the other."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=positive, metavar="N", help=f"processes on this machine, default: {default}")
    where.add_argument(
        "--scheduler", metavar="ADDRESS", help="Dask cluster to use instead, such as tcp://10.0.0.1:8786"
    )
