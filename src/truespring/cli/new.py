"""The verb `new`: write a commented study as a template."""

import argparse
import json
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from truespring.cli.printing import print_json, show
from truespring.cli.verb import CONVERGED, Verb, one_of
from truespring.errors import TruespringError


def _kinds() -> dict[str, Traversable]:
    """Return the studies in the folder `examples` of the package, by kind."""
    studies = (one for one in _examples().iterdir() if one.name.endswith(".toml"))
    return {study.name.removesuffix(".toml"): study for study in sorted(studies, key=lambda one: one.name)}


def _examples() -> Traversable:
    """Return the folder of the studies, with their meshes and images."""
    return files("truespring").joinpath("examples")


def _add(parser: argparse.ArgumentParser) -> None:
    kinds = _kinds()
    about = {kind: study.read_text(encoding="utf-8").splitlines()[0].strip("# ") for kind, study in kinds.items()}
    what = "\n".join(f"  {kind:10}{text}" for kind, text in about.items())
    parser.description = f"{parser.description}\n\nkinds:\n{what}"
    parser.add_argument("kind", **one_of(kinds), metavar="KIND", help=f"{', '.join(kinds)}")
    parser.add_argument(
        "file",
        nargs="?",
        type=Path,
        metavar="FILE",
        help="file to write, default: KIND.toml; existing files are not overwritten",
    )


def _run(options: argparse.Namespace) -> int:
    kind = options.kind
    study = Path(f"{kind}.toml") if options.file is None else options.file
    if study.suffix != ".toml":
        raise TruespringError(f"{study}: the name of a study file ends in .toml")
    text = _kinds()[kind].read_text(encoding="utf-8")
    written: dict[Path, bytes] = {study: b""}
    for beside in _examples().iterdir():  # a mesh or an image is written beside the study, with the same stem
        if beside.name.startswith(f"{kind}.") and not beside.name.endswith(".toml"):
            file = study.with_suffix(Path(beside.name).suffix)
            text = text.replace(json.dumps(beside.name), json.dumps(file.name, ensure_ascii=False))
            written[file] = beside.read_bytes()
    written[study] = text.encode()
    for file in written:
        if file.exists() or file.is_symlink():
            raise TruespringError(f"{file} exists: choose another name, truespring new {kind} FILE")
    for file, content in written.items():
        try:
            with file.open("xb") as stream:
                stream.write(content)
        except OSError as error:
            raise TruespringError(f"{file} cannot be written: {error.strerror}") from None
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
