"""The command: runs one verb and turns whatever happens into an exit code and a line on standard error."""

import argparse
import gc
import importlib
import io
import os
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from truespring.cli.parser import parse
from truespring.cli.printing import say
from truespring.cli.verb import CLOSED_PIPE, CONVERGED, INTERRUPTED, NOT_CONVERGED, WRONG_INPUT
from truespring.errors import TruespringError, one_line

# Options that change what is printed, not what is computed.
_ONLY_PRINTING = ("--json", "--quiet", "-q", "--verbose", "-v")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 converged, 1 not, 2 the input is wrong."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed before the command began: the next file opened would take its place
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):  # a character that a terminal cannot show is no reason to stop
            stream.reconfigure(errors="backslashreplace")
    try:
        code = _run_verb(sys.argv[1:] if arguments is None else list(arguments))
    except SystemExit as end:  # from the parser, which has printed help or what is wrong
        code = end.code if isinstance(end.code, int) else CONVERGED
    try:
        sys.stdout.flush()
    except OSError as error:
        failed = _output_failed(error)
        return code or failed
    return code


def _output_failed(error: OSError) -> int:
    """Return the exit code for standard output that cannot be written; drop what Python would still write to it.

    A reader that has closed its end, such as `head`, has read enough: nothing is printed then.
    """
    closed = isinstance(error, BrokenPipeError)
    if not closed:
        say(f"standard output cannot be written: {error.strerror}")
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
    return CLOSED_PIPE if closed else NOT_CONVERGED


def _run_verb(arguments: list[str]) -> int:
    try:
        options = parse(arguments)
        if options is None:
            return WRONG_INPUT
        options.command = shlex.join(["truespring", *(one for one in arguments if one not in _ONLY_PRINTING)])
        _load(options)
        with _threads(options.threads), ExitStack() as options.reserved:
            code: int = options.run(options)
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
    except OSError as error:
        if error.filename is None:  # a stream: errors of files name the file
            return _output_failed(error)
        say(f"{error.filename}: {error.strerror}")
        return NOT_CONVERGED
    except Exception as error:
        if sys.flags.dev_mode:  # python -X dev shows where
            raise
        say(f"internal error, please report it with the study: {type(error).__name__}: {one_line(str(error))}")
        return NOT_CONVERGED


def _load(options: argparse.Namespace) -> None:
    """Import what every verb but `new` needs with the garbage collector off, and exempt it from later collections.

    Modules stay in memory; scanning them again and again took a tenth of the time of a small study.
    """
    if options.verb == "new" or "truespring.study" in sys.modules:  # a process that runs several commands
        return
    gc.disable()
    try:
        importlib.import_module("truespring.study")
    finally:
        gc.freeze()
        gc.enable()


@contextmanager
def _threads(limit: int | None) -> Iterator[None]:
    """Limit the threads of the linear algebra and of compiled loops, if there is a limit."""
    with ExitStack() as stack:
        if limit is not None:
            from threadpoolctl import threadpool_limits

            from truespring.kernels.threads import set_threads

            stack.enter_context(threadpool_limits(limit))
            stack.callback(set_threads, None)
            set_threads(limit)
        yield
