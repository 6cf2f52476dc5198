"""A study with other values: keys with dots, such as material.young or load.1.force, and what they are set to."""

import copy
import re
from collections.abc import Collection, Mapping
from typing import Any

from truespring.errors import StudyError, nearest
from truespring.study import schema

#: How keys are written, for messages.
KEYS = "a key is written with dots, and lists count from 1: material.young, mesh.elements.2, load.1.force"


def changed(tables: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a study, as TOML gives them, with other values; those given stay as they are.

    Raises StudyError where a key leads nowhere. Whether its last part and its value are allowed is for the schema.
    """
    new = copy.deepcopy(dict(tables))
    for key, value in changes.items():
        *way, last = key_parts(key)
        holder: Any = new
        for depth, part in enumerate(way):
            holder = _entered(holder, part, key, depth)
        if holder is new:
            _refuse_unknown(str(last), schema.StudyKeys.model_fields, key)
        place = _place(holder, last, key) if isinstance(last, int) else _word(holder, last, key)
        holder[place] = copy.deepcopy(value)
    return new


def key_parts(key: str) -> list[str | int]:
    """Cut a key at its dots; numbers are places in lists, counted from 0 here. Raises StudyError where it is none."""
    if not re.fullmatch(r"[A-Za-z_][\w-]*(\.[\w-]+)*", key):
        raise StudyError(f"'{key}' is no key: {KEYS}")
    parts: list[str | int] = [part if not part.isdigit() else int(part) - 1 for part in key.split(".")]
    if key.startswith("models.") and len(parts) > 1:  # a model may be called by a number
        parts[1] = key.split(".")[1]
    return parts


def value_at(table: Any, key: str) -> Any:
    """Return what a checked study, a StudyKeys, holds at a key, in SI."""
    for part in key_parts(key):
        if isinstance(part, int):
            table = table[part]
        else:
            table = table[part] if isinstance(table, Mapping) else getattr(table, part)
    return table


def _entered(holder: Any, part: str | int, key: str, depth: int) -> Any:
    """What is at `part` of a table or a list; a table that the study leaves out is made, a model is not."""
    if isinstance(part, int):
        return holder[_place(holder, part, key)]
    if _word(holder, part, key) not in holder:
        if depth == 0:
            _refuse_unknown(part, schema.StudyKeys.model_fields, key)
        if depth == 1 and key.startswith("models."):
            raise StudyError(f"{key}: '{part}' is no model of the study{nearest(part, holder)}: {', '.join(holder)}")
        holder[part] = {}
    return holder[part]


def _word(holder: Any, word: str, key: str) -> str:
    if isinstance(holder, list):
        raise StudyError(f"{key}: '{word}' is no number, and what is before it is a list: {KEYS}")
    if not isinstance(holder, dict):
        raise StudyError(f"{key}: '{word}' is looked for in {holder!r}, which is no table: {KEYS}")
    return word


def _place(holder: Any, index: int, key: str) -> int:
    if not isinstance(holder, list):
        raise StudyError(f"{key}: {index + 1} is the number of an entry, and what is before it is no list: {KEYS}")
    if not 0 <= index < len(holder):
        raise StudyError(f"{key}: there is no entry {index + 1}: the study has {len(holder)}, counted from 1")
    return index


def _refuse_unknown(word: str, known: Collection[str], key: str) -> None:
    if word not in known:
        raise StudyError(f"{key}: '{word}' is no table of a study{nearest(word, known)}: {', '.join(known)}")
