"""Convert the errors that pydantic finds in a study file to messages of one line each."""

import re
from typing import Any, get_args

from pydantic import ValidationError

from truespring.errors import close_words, nearest, one_line, shown
from truespring.study.places import Key, Places
from truespring.study.schema import MESH_FORMS, MODEL_KINDS, SHAPES, Keys, StudyKeys

_OTHER_MESHES = "file = a mesh file, voxels = a label image, nodes and springs = CSV files"


def fault_lines(places: Places, error: ValidationError) -> list[str]:
    """Return one line per error; leave out a missing key if an unknown key beside it is a likely misspelling."""
    faults = error.errors()
    meant: set[Key] = set()
    for fault in faults:
        if fault["type"] == "extra_forbidden":
            *around, word = fault["loc"]
            meant.update((*around, guess) for guess in close_words(str(word), _allowed_keys(tuple(around))))
    return [_line(places, fault) for fault in faults if fault["type"] != "missing" or fault["loc"] not in meant]


def _line(places: Places, fault: Any) -> str:
    """Return the message of one error: file, line, key, value and what is allowed."""
    key = _without_tag(fault["loc"])
    place = places.of(key)
    value, text = fault["input"], str(fault["msg"])
    match fault["type"]:
        case "missing":
            return f"{place}: is required and missing"
        case "extra_forbidden":
            allowed = _allowed_keys(fault["loc"][:-1])
            found = "" if isinstance(value, dict | list) else f" = {shown(value)}"
            return f"{place}{found}: unknown key{nearest(str(key[-1]), allowed)}; allowed: {', '.join(allowed)}"
        case "value_error":
            return f"{place}: {one_line(text.removeprefix('Value error, '))}"
        case "literal_error":
            expected = fault["ctx"]["expected"]
            words = re.findall(r"'([^']*)'", expected)
            return f"{place} = {shown(value)}: allowed: {expected}{nearest(shown(value), words)}"
        case "union_tag_invalid" | "union_tag_not_found" if key == ("mesh",):
            tag = value.get("shape") if isinstance(value, dict) else value
            if tag is None:
                return f"{place}: shape is required and missing; allowed: {', '.join(SHAPES)}; or {_OTHER_MESHES}"
            allowed_shapes = " or ".join(f"'{shape}'" for shape in SHAPES)
            close = nearest(shown(tag), SHAPES)
            return f"{place}.shape = {shown(tag)}{close}; allowed: {allowed_shapes}; or {_OTHER_MESHES}"
        case "union_tag_invalid" | "union_tag_not_found":
            tag = value.get("kind") if isinstance(value, dict) else value
            return f"{place}: kind = {shown(tag)}{nearest(shown(tag), MODEL_KINDS)}; allowed: {', '.join(MODEL_KINDS)}"
        case "string_pattern_mismatch" if fault["loc"][-1] == "[key]":
            return f"{place}: a model's name may have letters, digits, '_' and '-' only, since files are named by it"
        case _:
            found = "" if isinstance(value, dict | list) and len(str(value)) > 60 else f" = {shown(value)}"
            return f"{place}{found}: {text[0].lower()}{text[1:]}"


def _without_tag(loc: Key) -> Key:
    """Return the key without the tags that pydantic inserts: the kind of a model, the form of a mesh, and '[key]'."""
    key = loc[:2] + loc[3:] if loc[0] == "models" and len(loc) > 2 else loc
    key = key[:1] + key[2:] if key[0] == "mesh" and len(key) > 2 else key
    return tuple(part for part in key if part != "[key]")


def _allowed_keys(loc: Key) -> list[str]:
    """Return the allowed keys of the table at `loc`, a location as pydantic reports it."""
    match loc:
        case ():
            return list(StudyKeys.model_fields)
        case ("mesh", form, *rest):
            keys: type[Keys] = MESH_FORMS[str(form)]
        case ("models", _, kind, *rest):
            keys = MODEL_KINDS[str(kind)]
        case (part, *rest):
            keys, rest = _keys_in(StudyKeys.model_fields[str(part)].annotation), []
    for part in rest:
        keys = _keys_in(keys.model_fields[str(part)].annotation)
    return list(keys.model_fields)


def _keys_in(annotation: Any) -> type[Keys]:
    """Return the subclass of Keys in a type such as `list[RegionKeys] | None`."""
    held = [annotation]
    while not (isinstance(held[0], type) and issubclass(held[0], Keys)):
        held = [*held[1:], *get_args(held[0])]
    return held[0]
