"""The verb `live`: a session of a study in a browser."""

import argparse
import sys
from pathlib import Path

from truespring.cli.printing import say, show, writing
from truespring.cli.verb import CONVERGED, Verb, seconds


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", help="study file (TOML)")
    parser.add_argument("--model", metavar="NAME", help="model that moves, default: the model of [compare]")
    parser.add_argument(
        "--reference",
        metavar="NAME",
        help="model that is computed beside it, default: the last reference of [compare] by finite elements",
    )
    parser.add_argument(
        "--coarsen",
        type=_factor,
        default="auto",
        metavar="N",
        help="elements N times as large; default: auto, the smallest N for which this machine keeps real time",
    )
    parser.add_argument("--port", type=_port, default=0, metavar="N", help="port, default: a free one")
    parser.add_argument(
        "--haptic",
        type=_port,
        metavar="N",
        help="UDP port of a haptic device at 1 kHz, 0 for a free one: docs/live.md describes its packets",
    )
    parser.add_argument("--no-browser", action="store_true", help="print the address only, and open no browser")
    parser.add_argument("--no-twin", action="store_true", help="compute no reference beside the model")
    parser.add_argument(
        "--record", type=Path, metavar="DIR", help="folder for the session as a study, written at the end"
    )
    parser.add_argument("--seconds", type=seconds, metavar="N", help="end after N seconds, default: with Ctrl+C")


def _factor(text: str) -> float | str:
    """Return "auto", or the text as a factor of at least 1."""
    if text == "auto":
        return text
    number = float(text)
    if not 1 <= number <= _LARGEST:
        raise argparse.ArgumentTypeError(f"{text} is not auto or a number from 1 to {_LARGEST:g}")
    return number


_LARGEST = 100.0


def _port(text: str) -> int:
    """Return the text as the number of a port; 0 is any free one."""
    number = int(text)
    if not 0 <= number <= _PORTS:
        raise argparse.ArgumentTypeError(f"{text} is not a port from 0 to {_PORTS}")
    return number


_PORTS = 65535


def _run(options: argparse.Namespace) -> int:
    from truespring.live.haptic_loop import HapticLoop
    from truespring.live.opening import opened
    from truespring.live.server import require, serve

    require()
    loop, title = opened(
        Path(options.study),
        model=options.model,
        reference=options.reference,
        coarsen=options.coarsen,
        twin=not options.no_twin,
        folder=options.record,
        haptic=options.haptic,
    )

    def known(address: str) -> None:
        show(address)
        if isinstance(loop, HapticLoop):
            show(f"haptic port {loop.device.port}, token {loop.device.token:016x}")
        sys.stdout.flush()  # a script waits for it
        if not options.no_browser:
            import webbrowser

            webbrowser.open(address)

    if not options.quiet:
        for line in (*loop.messages, *loop.live.notes):
            say(f"note: {line}")
    serve(loop, title, port=options.port, seconds=options.seconds, opened=known)
    with writing(options.record or Path()):
        written = loop.save()
    if written:
        say(written)
    return CONVERGED


LIVE = Verb(
    "live",
    "pull the body of a study in a browser, beside FEM",
    _add,
    _run,
    (
        "truespring live strip.toml",
        "truespring live block.toml --port 8765 --no-browser --record session",
    ),
    ("quiet", "threads"),
)
