"""The verb `new`: write a commented study as a template."""

import argparse
from pathlib import Path

from truespring.cli.printing import print_json, show
from truespring.cli.verb import CONVERGED, Verb, one_of
from truespring.templates import kinds, write_template


def _add(parser: argparse.ArgumentParser) -> None:
    several = kinds()
    what = "\n".join(f"  {kind:10}{text}" for kind, text in several.items())
    parser.description = f"{parser.description}\n\nkinds:\n{what}"
    parser.add_argument("kind", **one_of(several), metavar="KIND", help=f"{', '.join(several)}")
    parser.add_argument(
        "file",
        nargs="?",
        type=Path,
        metavar="FILE",
        help="file to write, default: KIND.toml; existing files are not overwritten",
    )


def _run(options: argparse.Namespace) -> int:
    study = Path(f"{options.kind}.toml") if options.file is None else options.file
    written = write_template(options.kind, study)
    if options.json:
        print_json({"files": [str(file) for file in written]})
    elif options.quiet:
        show(study)
    else:
        show(*(f"written: {file}" for file in written))
        show(f"next:    truespring check {study}", f"         truespring verify {study}")
    return CONVERGED


NEW = Verb(
    "new",
    "write a commented study as a template, with its mesh or image",
    _add,
    _run,
    ("truespring new strip", "truespring new organ liver.toml"),
    ("json", "quiet"),
)
