"""The class of verbs, exit codes, and options that several verbs share."""

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
    """A verb of the command line.

    Attributes:
        name: name of the verb.
        summary: one line for the list of verbs and the top of the verb's help.
        add: adds the arguments to a parser; called only for the verb of a command line.
        run: runs the verb and returns its exit code.
        examples: command lines at the end of the verb's help, on the studies that `truespring new KIND` writes.
        common: the options in COMMON that the verb's help lists; the verb accepts the others, without effect.
        threads: help text of --threads.
    """

    name: str
    summary: str
    add: Callable[[argparse.ArgumentParser], Any]
    run: Callable[[argparse.Namespace], int]
    examples: tuple[str, ...]
    common: tuple[str, ...] = ("json", "quiet", "threads")
    threads: str = "threads of the linear algebra, default: all cores"


def positive(text: str) -> int:
    """Return the text as an integer of at least 1."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{number} is not a positive number")
    return number


def seconds(text: str) -> float:
    """Return the text as a positive, finite number of seconds."""
    number = float(text)
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number of seconds")
    return number


def relative_error(text: str) -> float:
    """Return the text as a relative error between 0 and 1."""
    number = float(text)
    if not 0 < number < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a relative error between 0 and 1")
    return number


class _Choices(tuple[str, ...]):
    """Names of an option's values, to which installed packages add those of a group of entry points.

    The packages are searched only for a value that is none of the names: that takes longer than to print the help.
    """

    group = ""

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or name in self.further

    @property
    def further(self) -> tuple[str, ...]:
        """The names that installed packages add."""
        if not self.group:
            return ()
        from truespring.plugins import entry_points

        return tuple(dict.fromkeys(point.name for point in entry_points(self.group)))


def one_of(names: Iterable[str], group: str = "") -> dict[str, Any]:
    """Return keyword arguments of add_argument for an option with values `names`; an error suggests the nearest.

    Entry points of installed packages in `group` are values, too; they are not in the help.
    """
    choices = _Choices(names)
    choices.group = group

    def known(text: str) -> str:
        if text not in choices:
            allowed = (*choices, *choices.further)
            raise argparse.ArgumentTypeError(
                f"'{text}' is unknown{nearest(text, allowed)}; allowed: {', '.join(allowed)}"
            )
        return text

    return {"type": known, "choices": choices}


#: Options that every verb accepts, by attribute of the parsed options.
COMMON: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "json": (("--json",), {"action": "store_true", "help": "print only one JSON object on standard output"}),
    "quiet": (
        ("-q", "--quiet"),
        {"action": "store_true", "help": "print only errors and the path of the report or file written"},
    ),
    "verbose": (
        ("-v", "--verbose"),
        {"action": "store_true", "help": "print the effective moduli of springs as a table, not in one line"},
    ),
    "threads": (("--threads",), {"type": positive, "metavar": "N"}),
}


def add_common(parser: argparse.ArgumentParser, verb: Verb) -> None:
    """Add the options in COMMON; the help omits those without effect on the verb."""
    for name, (options, more) in COMMON.items():
        help_text = verb.threads if name == "threads" else more["help"]
        parser.add_argument(*options, **{**more, "help": help_text if name in verb.common else argparse.SUPPRESS})


def add_studies(parser: argparse.ArgumentParser) -> None:
    """Add the argument for one or more study files."""
    parser.add_argument("study", nargs="+", help="study file (TOML)")


def add_out(parser: argparse.ArgumentParser, folder: str = "out") -> None:
    """Add --out, the folder for results, with its default."""
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
    """Add --workers and --scheduler, which exclude each other."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=positive, metavar="N", help=f"processes on this machine, default: {default}")
    where.add_argument(
        "--scheduler", metavar="ADDRESS", help="address of a Dask cluster to use instead, such as tcp://10.0.0.1:8786"
    )
