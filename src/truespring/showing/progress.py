"""Progress bars: in a notebook as HTML, in a terminal by rich; without one of the two nothing is shown.

The verbs of the library know callbacks only. Each function here yields the callback of one kind of verb.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from html import escape
from typing import Any, Protocol, Self, TypeVar

from truespring.errors import OutputError

Callback = TypeVar("Callback", bound=Callable[..., None])

# Shortest interval between updates in a notebook [s].
_EVERY = 0.1


class Rows(Protocol):
    """Rows of a progress display: each has a label and a bar."""

    def show(self, label: str, done: float, total: float | None, note: str = "") -> None:
        """Set the bar of a row to `done` of `total`; None if the total is not known yet."""

    def close(self) -> None:
        """Remove the display."""


def new_rows() -> Rows | None:
    """Return a display for a notebook or the terminal of standard error; None without one."""
    shell = _notebook()
    if shell is not None:
        return _NotebookRows()
    return _TerminalRows() if sys.stderr is not None and sys.stderr.isatty() else None


def _notebook() -> Any:
    """Return the shell of IPython if it has a Jupyter kernel, else None; does not import IPython."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell if shell is not None and hasattr(shell, "kernel") else None


@contextmanager
def rows() -> Iterator[Rows | None]:
    """Yield a display, or None; remove it at the end."""
    display = new_rows()
    try:
        yield display
    finally:
        if display is not None:
            display.close()


def chosen(
    progress: bool | Callback | None, shown: Callable[[], AbstractContextManager[Callback | None]]
) -> AbstractContextManager[Callback | None]:
    """Return the context of the argument `progress` of a verb: True shows a bar, a callback is called instead."""
    if isinstance(progress, bool):
        return shown() if progress else nullcontext()
    if progress is not None and not callable(progress):
        raise OutputError(f"progress = {progress!r}: True, False or a function is expected")
    return nullcontext(progress)


@contextmanager
def bars() -> Iterator[Callable[[str, str, float], None] | None]:
    """Yield a callback that shows the share of the load that a model of a study has reached."""
    with rows() as display:
        if display is None:
            yield None
            return
        yield lambda study, model, share: display.show(f"{study}: {model}", share, 1.0)


@contextmanager
def steps(what: str) -> Iterator[Callable[[str, float], None] | None]:
    """Yield a callback that shows the current step and the share of the work done."""
    with rows() as display:
        if display is None:
            yield None
            return
        yield lambda step, share: display.show(what, share, 1.0, f"{share:.0%}, {step}")


@contextmanager
def paths() -> Iterator[Callable[[str, int, int], None] | None]:
    """Yield a callback that shows the path that was solved, and how many are solved and needed so far."""
    with rows() as display:
        if display is None:
            yield None
            return
        yield lambda path, done, needed: display.show("paths", done, needed, f"{done} of {needed}: {path}")


@contextmanager
def counting(what: str) -> Iterator[Callable[[int, int, int], None] | None]:
    """Yield a callback that shows how many of `what` are done, failed and planned."""
    with rows() as display:
        if display is None:
            yield None
            return

        def count(done: int, failed: int, total: int) -> None:
            display.show(what, done, total, f"{done} of {total}{f', {failed} failed' if failed else ''}")

        yield count


class ProgressBar:
    """A progress bar for `ts.solve`, in a notebook or terminal; without one of the two it shows nothing.

    It disappears at full load, or at the end of a `with` block.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> with ts.ProgressBar("springs") as bar:
        ...     solution = ts.solve(problem, ts.Springs("gaussian"), progress=bar)
        >>> solution.load_factor
        1.0
    """

    def __init__(self, label: str = "load factor") -> None:
        """Name the bar."""
        self.label = label
        self._display: Rows | None = None

    def __enter__(self) -> Self:
        """Return the bar."""
        return self

    def __exit__(self, *error: object) -> None:
        """Remove the bar."""
        self.close()

    def __call__(self, load_factor: float, iteration: int, residual: float) -> None:
        """Show a load factor, and the residual of an iteration."""
        if self._display is None:
            self._display = new_rows()
        if self._display is not None:
            self._display.show(self.label, load_factor, 1.0, f"iteration {iteration}, residual {residual:.0e}")

    def close(self) -> None:
        """Remove the bar; a further call shows it again."""
        if self._display is not None:
            self._display.close()
        self._display = None


class _NotebookRows:
    """Rows as a table of HTML that replaces itself; its colours are those of the notebook."""

    def __init__(self) -> None:
        self._rows: dict[str, tuple[float, float | None, str]] = {}
        self._handle: Any = None
        self._next = 0.0

    def show(self, label: str, done: float, total: float | None, note: str = "") -> None:
        new = label not in self._rows
        self._rows[label] = done, total, note
        if new or time.monotonic() >= self._next or done == total:
            self._next = time.monotonic() + _EVERY
            self._draw()

    def _draw(self) -> None:
        page = _display().HTML(rows_html(self._rows))
        if self._handle is None:
            self._handle = _display().display(page, display_id=True)
        else:
            self._handle.update(page)

    def close(self) -> None:
        if self._handle is not None:
            self._handle.update(_display().HTML(""))


def _display() -> Any:
    """Return the module of IPython that displays; it has no types."""
    from IPython import display

    return display


def rows_html(shown: dict[str, tuple[float, float | None, str]]) -> str:
    """Return rows as HTML: label, bar and note of each."""
    lines = []
    for label, (done, total, note) in shown.items():
        bar = (
            "<progress></progress>" if total is None else f'<progress value="{done:.6g}" max="{total:.6g}"></progress>'
        )
        text = note or (f"{done / total:.0%}" if total else "")
        lines.append(f"<div>{bar} {escape(label)} <small>{escape(text)}</small></div>")
    return "".join(lines)


class _TerminalRows:
    """Rows of rich on standard error, removed at the end."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        text = TextColumn("{task.description}", markup=False)
        console = Console(stderr=True, highlight=False, markup=False, emoji=False)
        columns = (text, BarColumn(), TextColumn("{task.fields[note]}", markup=False), TimeElapsedColumn())
        self._bars = Progress(*columns, TextColumn("left:"), TimeRemainingColumn(), console=console, transient=True)
        self._tasks: dict[str, Any] = {}
        self._bars.start()

    def show(self, label: str, done: float, total: float | None, note: str = "") -> None:
        if label not in self._tasks:
            self._tasks[label] = self._bars.add_task(label, total=total, note=note)
        text = note or (f"{done / total:.0%}" if total else "")
        self._bars.update(self._tasks[label], completed=done, total=total, note=text)

    def close(self) -> None:
        self._bars.stop()
