"""The files that a study names, and the study as it is written to another folder."""

import copy
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from pydantic.fields import FieldInfo

from truespring.study.places import Key
from truespring.study.read import Study
from truespring.study.schema import FILE, Keys


def moved_document(study: Study, folder: Path) -> dict[str, Any]:
    """Return the tables of a study, with changed values, for a file in another folder: names of files lead from there.

    Names without a file beside the study stay as they are, as those of images of PyVista.
    """
    document = copy.deepcopy(dict(study.text.document))
    for *way, last in _file_keys(study.keys, ()):
        holder: Any = document
        for part in way:
            holder = holder[part]
        file = study.text.places.beside(holder[last])
        if file.exists():
            holder[last] = _from(folder, file)
    return document


def _from(folder: Path, file: Path) -> str:
    """Return the name of a file relative to a folder; the whole path on another drive."""
    try:
        return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
    except ValueError:
        return file.resolve().as_posix()


def _file_keys(keys: Keys, at: Key) -> Iterator[Key]:
    """Yield the places of names of files in the keys of a study; `at` is the place of `keys`."""
    for name, field in type(keys).model_fields.items():
        value = getattr(keys, name)
        if isinstance(value, str) and name in keys.model_fields_set and _names_file(field):
            yield (*at, name)
        for part, inner in _inside(value):
            yield from _file_keys(inner, (*at, name, *part))


def _inside(value: Any) -> Iterator[tuple[Key, Keys]]:
    """Yield the keys in a value with their places in it."""
    if isinstance(value, Keys):
        yield (), value
    several = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    yield from (((part,), one) for part, one in several if isinstance(one, Keys))


def _names_file(field: FieldInfo) -> bool:
    """Return whether a string in a field is the name of a file."""
    inner = [getattr(one, "__metadata__", ()) for one in get_args(field.annotation)]
    return any(one is FILE for several in (field.metadata, *inner) for one in several)
