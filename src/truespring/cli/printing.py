"""Print tables and JSON on standard output, errors and progress on standard error."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from truespring.study import Study

# Interval between lines of progress [s] if standard error is not a terminal.
_EVERY = 10.0


class StandardOutputError(Exception):
    """Standard output cannot be written: its reader has closed the pipe, or the disk is full.

    Attributes:
        reason: the error of the stream.
    """

    def __init__(self, reason: OSError) -> None:
        super().__init__(reason)
        self.reason = reason


@contextmanager
def standard_output() -> Iterator[None]:
    """Convert an OSError to a StandardOutputError; only writes to standard output belong into the block."""
    try:
        yield
    except OSError as error:
        raise StandardOutputError(error) from None


def show(*lines: object) -> None:
    """Print lines on standard output, whatever the options are."""
    with standard_output():
        print(*lines, sep="\n")


def say(text: str) -> None:
    """Print a line on standard error; ignore errors of writing."""
    with suppress(OSError):
        print(f"truespring: {text}", file=sys.stderr, flush=True)


def print_json(value: Any) -> None:
    """Print a value as JSON on standard output."""
    show(json.dumps(value, indent=2, allow_nan=False))


def print_each(values: dict[str, Any]) -> None:
    """Print a value per study as JSON: the value alone for one study, an object by stem for several."""
    print_json(values if len(values) > 1 else next(iter(values.values())))


def console(options: argparse.Namespace) -> "Console":
    """Return the console for tables and sentences; it prints nothing with --quiet or --json."""
    from rich.console import Console

    class Plain(Console):
        """A console that raises StandardOutputError for `main` to handle."""

        def print(self, *parts: Any, **style: Any) -> None:
            with standard_output():
                super().print(*parts, **style)

        def on_broken_pipe(self) -> None:
            raise  # the exception being handled

    return Plain(quiet=options.quiet or options.json, highlight=False, markup=False, emoji=False, soft_wrap=False)


def print_file(options: argparse.Namespace, what: str, file: object) -> None:
    """Print the path of a report or another file; with --quiet only the path, with --json nothing."""
    if not options.json:
        show(file if options.quiet else f"{what}: {file}")


def writing(out: Path) -> AbstractContextManager[None]:
    """Convert an OSError to an OutputError that names the folder of the results."""
    from truespring.outputs import writing

    return writing(out)


def reserve(options: argparse.Namespace, studies: "Sequence[Study]" = ()) -> None:
    """Lock the output folders of studies, or --out without studies, until the command ends.

    Raises OutputError if a folder cannot be written or another run has locked it.
    """
    from truespring.outputs import Lock

    with writing(options.out):
        for folder in [options.out / study.stem for study in studies] or [options.out]:
            options.reserved.enter_context(Lock(folder))


class _Lines:
    """Progress as lines at intervals, if standard error is not a terminal."""

    def __init__(self) -> None:
        self._next = time.monotonic() + _EVERY

    def show(self, text: Callable[[], str]) -> None:
        """Print a line if the interval has passed since the last one."""
        if time.monotonic() >= self._next:
            say(text())
            self._next = time.monotonic() + _EVERY


@contextmanager
def progress(options: argparse.Namespace) -> Iterator[Callable[[str, str, float], None] | None]:
    """Yield a callback that shows the progress of each model by a bar or by lines; None with --quiet."""
    if options.quiet:
        yield None
        return
    if not sys.stderr.isatty():
        lines = _Lines()
        yield lambda study, model, share: lines.show(lambda: f"{study}: {model}: {share:.0%}")
        return
    from rich.console import Console
    from rich.progress import Progress, TaskID

    tasks: dict[str, TaskID] = {}
    with Progress(console=Console(stderr=True), transient=True) as bars:

        def advance(study: str, model: str, share: float) -> None:
            if model not in tasks:
                tasks[model] = bars.add_task(f"{study}: {model}", total=1.0)
            bars.update(tasks[model], completed=share)

        yield advance


@contextmanager
def counting(
    options: argparse.Namespace, what: str
) -> Iterator[tuple[Callable[[int, int, int], None] | None, Callable[[str], None] | None]]:
    """Yield callbacks that show how many of `what` are done, failed and planned, and that print a note.

    Progress is a bar or, off a terminal, lines at intervals. Both callbacks are None with --quiet.
    """
    if options.quiet:
        yield None, None
        return
    if not sys.stderr.isatty():
        lines = _Lines()

        def count(done: int, failed: int, total: int) -> None:
            lines.show(lambda: f"{done} of {total} {what}{f', {failed} failed' if failed else ''}")

        yield count, say
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
    screen = Console(stderr=True, highlight=False, markup=False, emoji=False)
    with Progress(*columns, TextColumn("left:"), TimeRemainingColumn(), console=screen, transient=True) as bars:
        task = bars.add_task(what, total=None)

        def advance(done: int, failed: int, total: int) -> None:
            text = f"{what}, {failed} failed" if failed else what
            bars.update(task, completed=done, total=total, description=text)

        yield advance, lambda text: screen.print(f"truespring: {text}", soft_wrap=True)
