"""Run one verb; convert exceptions to exit codes and messages on standard error."""

import argparse
import gc
import importlib
import io
import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path

from truespring.cli.launch import Launch, launch
from truespring.cli.parser import parse
from truespring.cli.printing import StandardOutputError, say, standard_output
from truespring.cli.verb import CLOSED_PIPE, CONVERGED, INTERRUPTED, NOT_CONVERGED, WRONG_INPUT
from truespring.errors import OneProcessError, TruespringError, one_line
from truespring.report.command import command_line

# Number of characters of a study in which its mesh is looked for.
_BEGINNING = 10_000


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code, one of those in `truespring.cli.verb`."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the caller: the next opened file would get its descriptor
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):  # no error for characters that the terminal cannot show
            stream.reconfigure(errors="backslashreplace")
    started = launch(os.environ)
    with started.silenced():
        try:
            code = _run_verb(sys.argv[1:] if arguments is None else list(arguments), started)
        except SystemExit as end:  # from the parser, after it has printed the help or an error
            code = end.code if isinstance(end.code, int) else CONVERGED
    code = started.end(code)
    try:
        with standard_output():
            sys.stdout.flush()
    except StandardOutputError as error:
        failed = _output_failed(error.reason)
        return code or failed
    return code


def _output_failed(reason: OSError) -> int:
    """Return the exit code for an error of standard output, and redirect further output to the null device.

    Print the error, except for a closed pipe: its reader, such as `head`, needs no more.
    """
    closed = isinstance(reason, BrokenPipeError)
    if not closed:
        say(f"standard output cannot be written: {reason.strerror}")
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
    return CLOSED_PIPE if closed else NOT_CONVERGED


def _run_verb(arguments: list[str], started: Launch) -> int:
    """Parse and run a command line; return its exit code, and print an error as one line."""
    try:
        options = parse(arguments)
        if options is None:
            return WRONG_INPUT
        started.check_verb(options.verb)
        options.command, options.launch = command_line(arguments), started
        with _threads(options.threads), ExitStack() as compiling, ExitStack() as options.reserved:
            _load(options, compiling)
            code: int = options.run(options)
            started.orderly = True
            return code
    except TruespringError as error:
        for line in str(error).splitlines():
            say(line)
        return WRONG_INPUT
    except MemoryError:
        say("out of memory: use fewer elements")
        return NOT_CONVERGED
    except KeyboardInterrupt:
        return INTERRUPTED
    except StandardOutputError as error:
        return _output_failed(error.reason)
    except OSError as error:
        say(f"{error.filename or type(error).__name__}: {error.strerror or one_line(str(error))}")
        return NOT_CONVERGED
    except OneProcessError as error:
        say(f"one of {started.size} processes failed: {error}")
        return NOT_CONVERGED
    except Exception as error:
        if sys.flags.dev_mode:  # with python -X dev show the traceback
            raise
        say(f"internal error, please report it with the study: {type(error).__name__}: {one_line(str(error))}")
        return NOT_CONVERGED


def _load(options: argparse.Namespace, compiling: ExitStack) -> None:
    """Import the library without garbage collection, and exclude its objects from later collections.

    Modules stay in memory anyway; scanning them took a tenth of the time of a small study. `new` does not need them.
    Until `compiling` ends, a second process compiles kernels where that helps.
    """
    if options.verb == "new" or "truespring.study" in sys.modules:  # loaded by an earlier command of this process
        return
    gc.disable()
    try:
        if options.verb in ("verify", "solve") and options.launch.size == 1:
            compiling.enter_context(_compiling(options.study[0]))
        importlib.import_module("truespring.study")
    finally:
        gc.freeze()
        gc.enable()


def _compiling(study: str) -> AbstractContextManager[None]:
    """Return a context that compiles kernels in a second process, for the first command after the installation.

    The dimension is a guess from the text of the study: only rectangles and boxes have a size.
    """
    try:
        if not Path(study).is_file():  # a pipe is read only once
            return nullcontext()
        with Path(study).open(encoding="utf-8", errors="replace") as file:
            text = file.read(_BEGINNING)
    except (OSError, ValueError):  # reported by the reader
        return nullcontext()
    size = re.search(r"^size *= *\[([^\]\n]*)\]", text, re.MULTILINE)
    dim = len(size[1].split(",")) if size else 0
    if dim not in (2, 3):
        return nullcontext()
    from truespring.kernels.ahead import compiling_ahead

    return compiling_ahead(dim)


@contextmanager
def _threads(limit: int | None) -> Iterator[None]:
    """Limit the threads of linear algebra and compiled kernels; None sets no limit."""
    with ExitStack() as stack:
        if limit is not None:
            from threadpoolctl import threadpool_limits

            from truespring.kernels.threads import set_threads

            stack.enter_context(threadpool_limits(limit))
            stack.callback(set_threads, None)
            set_threads(limit)
        yield
