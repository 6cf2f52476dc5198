"""Commented studies to start from, with their meshes and images."""

import json
from collections.abc import Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import overload

from truespring.errors import TruespringError, nearest, shown


@overload
def new(kind: str) -> str: ...
@overload
def new(kind: str, path: str | Path) -> Path: ...
def new(kind: str, path: str | Path | None = None) -> str | Path:
    """Return the text of a commented study, or write it, as the command `truespring new`.

    Args:
        kind: "strip", "block" (3D), "mesh" (from a mesh file) or "organ" (from a label image).
        path: file to write; the mesh or image that the study needs is written beside it.

    Returns the text, or with `path` the path of the file. Raises TruespringError for an unknown kind, another suffix
    than .toml, or if a file exists or cannot be written.

    Example:
        >>> import truespring as ts
        >>> print(ts.new("strip").splitlines()[0])
        # A soft strip in 2D, clamped on the left and bent by a force on its right end.
    """
    if path is None:
        return _text(kind)
    write_template(kind, Path(path))
    return Path(path)


def kinds() -> dict[str, str]:
    """Return the kinds of studies, each with a description."""
    return {kind: _text(kind).splitlines()[0].strip("# ") for kind in _studies()}


def write_template(kind: str, study: Path) -> list[Path]:
    """Write a study, and its mesh or image beside it; return the paths of the files. Raises as `new`."""
    written = _files(kind, study)
    for file in written:
        if file.exists() or file.is_symlink():
            raise TruespringError(f"{file} exists: choose another name, existing files are not overwritten")
    for file, content in written.items():
        try:
            with file.open("xb") as stream:
                stream.write(content)
        except OSError as error:
            raise TruespringError(f"{file} cannot be written: {error.strerror}") from None
    return list(written)


def _files(kind: str, study: Path) -> Mapping[Path, bytes]:
    """Return the content of each file: the study first, a mesh or an image with the same stem."""
    if study.suffix != ".toml":
        raise TruespringError(f"{study}: the name of a study file ends in .toml")
    text, beside = _text(kind), {}
    for one in _examples().iterdir():
        if one.name.startswith(f"{kind}.") and not one.name.endswith(".toml"):
            file = study.with_suffix(Path(one.name).suffix)
            text = text.replace(json.dumps(one.name), json.dumps(file.name, ensure_ascii=False))
            beside[file] = one.read_bytes()
    return {study: text.encode(), **beside}


def _text(kind: str) -> str:
    studies = _studies()
    if not isinstance(kind, str) or kind not in studies:
        raise TruespringError(
            f"kind = {shown(kind)} is unknown{nearest(str(kind), studies)}; allowed: {', '.join(studies)}"
        )
    return studies[kind].read_text(encoding="utf-8")


def _studies() -> dict[str, Traversable]:
    """Return the studies in the folder `examples` of the package, by kind."""
    studies = (one for one in _examples().iterdir() if one.name.endswith(".toml"))
    return {study.name.removesuffix(".toml"): study for study in sorted(studies, key=lambda one: one.name)}


def _examples() -> Traversable:
    """Return the folder of the studies, with their meshes and images."""
    return files("truespring").joinpath("examples")
