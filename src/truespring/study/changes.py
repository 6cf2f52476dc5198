"""Change values of a study by dotted keys, such as material.young or load.1.force."""

import copy
import re
from collections.abc import Collection, Mapping
from typing import Any

from truespring.errors import StudyError, nearest
from truespring.study import schema

#: The syntax of keys, for error messages.
KEYS = "a key is written with dots, and lists count from 1: material.young, mesh.elements.2, load.1.force"


def changed(tables: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of the parsed TOML of a study with the values in `changes`, by dotted key.

    Raises StudyError if the parent of a key does not exist. The schema checks the last part of a key and its value.
    """
    new = copy.deepcopy(dict(tables))
    for key, value in changes.items():
        *way, last = key_parts(key)
        holder: Any = new
        for depth, part in enumerate(way):
            holder = _entered(holder, part, key, depth)
        if holder is new:
            _require_known(str(last), schema.StudyKeys.model_fields, key)
        place = _place(holder, last, key) if isinstance(last, int) else _word(holder, last, key)
        holder[place] = copy.deepcopy(value)
    return new


def key_parts(key: str) -> list[str | int]:
    """Split a key at its dots; numbers become list indices from 0. Raises StudyError if the syntax is wrong."""
    if not re.fullmatch(r"[A-Za-z_][\w-]*(\.[\w-]+)*", key):
        raise StudyError(f"'{key}' is not a key: {KEYS}")
    parts: list[str | int] = [part if not part.isdigit() else int(part) - 1 for part in key.split(".")]
    if key.startswith("models.") and len(parts) > 1:  # the name of a model may be a number
        parts[1] = key.split(".")[1]
    return parts


def value_at(table: Any, key: str) -> Any:
    """Return the value of a dotted key in `table`, the StudyKeys of a study; quantities are in SI units."""
    for part in key_parts(key):
        if isinstance(part, int):
            table = table[part]
        else:
            table = table[part] if isinstance(table, Mapping) else getattr(table, part)
    return table


def _entered(holder: Any, part: str | int, key: str, depth: int) -> Any:
    """Return the entry `part` of a table or list; create a missing table, except that of a model."""
    if isinstance(part, int):
        return holder[_place(holder, part, key)]
    if _word(holder, part, key) not in holder:
        if depth == 0:
            _require_known(part, schema.StudyKeys.model_fields, key)
        if depth == 1 and key.startswith("models."):
            raise StudyError(f"{key}: '{part}' is not a model of the study{nearest(part, holder)}: {', '.join(holder)}")
        holder[part] = {}
    return holder[part]


def _word(holder: Any, word: str, key: str) -> str:
    if isinstance(holder, list):
        raise StudyError(f"{key}: '{word}' follows a list and must be a number: {KEYS}")
    if not isinstance(holder, dict):
        raise StudyError(f"{key}: '{word}' follows {holder!r}, which is not a table: {KEYS}")
    return word


def _place(holder: Any, index: int, key: str) -> int:
    if not isinstance(holder, list):
        raise StudyError(f"{key}: {index + 1} does not follow a list: {KEYS}")
    if not 0 <= index < len(holder):
        raise StudyError(f"{key}: there is no entry {index + 1}: the list has {len(holder)}, counted from 1")
    return index


def _require_known(word: str, known: Collection[str], key: str) -> None:
    if word not in known:
        raise StudyError(f"{key}: '{word}' is not a table of a study{nearest(word, known)}: {', '.join(known)}")
