"""The tables of all keys of a study, from the schema by which studies are checked."""

import re
from collections.abc import Iterator
from typing import Any

from truespring.study.schema import StudyKeys

# What a quantity is, in the description of its value.
_QUANTITY = re.compile(r"^(.*?): a number in (.*?), or a string")
_BOUNDS = {"gt": "above", "minimum": "at least", "lt": "below", "maximum": "at most", "le": "at most", "ge": "at least"}


def study_keys() -> str:
    """Return the keys of a study as markdown: a section for each table, a row for each key."""
    schema = StudyKeys.model_json_schema()
    lines = ["## The study", "", *table(schema, "study")]
    places = {"": schema["properties"]}
    for name, one in schema["properties"].items():
        heads = list(references(one))
        several = len(heads) > 1
        for head in heads:
            lines += section(schema["$defs"][head], head, bracket(name, one), several)
    shown = {head for one in places[""].values() for head in references(one)}
    inner = [head for head in schema["$defs"] if head not in shown]
    for head in inner:
        lines += section(schema["$defs"][head], head, "a value of other tables", False)
    return "\n".join(lines)


def bracket(name: str, schema: dict[str, Any]) -> str:
    """Return the heading of a table as TOML writes it."""
    if schema.get("type") == "array":
        return f"`[[{name}]]`"
    return f"`[{name}.NAME]`" if "patternProperties" in schema else f"`[{name}]`"


def section(schema: dict[str, Any], head: str, where: str, several: bool) -> list[str]:
    """Return the lines of a table: heading, description, keys."""
    kinds = [one["const"] for one in schema["properties"].values() if "const" in one]
    more = f", {kinds[0]}" if kinds and several else f", {words(head)}" if several else ""
    title = f"## {words(head)}" if where.startswith("a value") else f"## {where}{more}"
    return ["", f"({anchor(head)})=", title, "", str(schema.get("description", "")), "", *table(schema, anchor(head))]


def table(schema: dict[str, Any], place: str) -> list[str]:
    """Return the rows of the keys of a table."""
    required = set(schema.get("required", ()))
    lines = ["| key | value | default | meaning |", "|---|---|---|---|"]
    for key, one in schema["properties"].items():
        default = "required" if key in required else as_toml(one.get("default"))
        cells = (f"[]{{#{place}-{key}}}`{key}`", form(one), default, one.get("description", ""))
        lines.append("| " + " | ".join(clean(cell) for cell in cells) + " |")
    return lines


def form(schema: dict[str, Any]) -> str:
    """Return the allowed values of a key in words."""
    quantity = _QUANTITY.match(schema.get("description", ""))
    if quantity and "anyOf" not in schema and schema.get("type") != "array":
        return f"{quantity[1]} [{quantity[2]}]"
    if "$ref" in schema:
        head = schema["$ref"].rsplit("/", 1)[-1]
        return f"[{words(head)}](#{anchor(head)})"
    if "const" in schema:
        return as_toml(schema["const"])
    if "enum" in schema:
        return ", ".join(as_toml(value) for value in schema["enum"])
    for key in ("anyOf", "oneOf"):
        if key in schema:
            forms = (form(one) for one in schema[key] if one.get("type") != "null")
            return " or ".join(dict.fromkeys(forms))
    if "patternProperties" in schema:
        return "a table for each name: " + form(next(iter(schema["patternProperties"].values())))
    if schema.get("type") == "array":
        count, each = numbers(schema), form(schema.get("items", {}))
        return f"list of {count}values: {each}" if count else f"list of {each}"
    if schema.get("type") == "object":
        keys = ", ".join(f"{key} = {form(one)}" for key, one in schema.get("properties", {}).items())
        return f"{{ {keys} }}" if keys else "table"
    kinds = schema.get("type", "any value")
    name = " or ".join(kinds) if isinstance(kinds, list) else str(kinds)
    bounds = [f"{word} {schema[key]:g}" for key, word in _BOUNDS.items() if key in schema]
    return ", ".join([name, *bounds])


def numbers(schema: dict[str, Any]) -> str:
    """Return how many values a list has, with a space, or nothing."""
    low, high = schema.get("minItems"), schema.get("maxItems")
    if low == high:
        return f"{low} " if low is not None else ""
    return f"{low} to {high} " if high is not None and low is not None else f"at least {low} " if low else ""


def references(schema: Any) -> Iterator[str]:
    """Yield the names of the tables that a schema refers to, each once."""
    seen: set[str] = set()
    left = [schema]
    while left:
        one = left.pop(0)
        if isinstance(one, dict):
            if "$ref" in one and (name := one["$ref"].rsplit("/", 1)[-1]) not in seen:
                seen.add(name)
                yield name
            left += [value for key, value in one.items() if key not in ("discriminator", "default")]
        elif isinstance(one, list):
            left += one


def words(head: str) -> str:
    """Return the name of a table in words: `NetworkFilesKeys` is "network files"."""
    return re.sub(r"(?<!^)(?=[A-Z])", " ", head.removesuffix("Keys")).lower()


def anchor(head: str) -> str:
    """Return the anchor of a table."""
    return f"keys-{words(head).replace(' ', '-')}"


def as_toml(value: Any) -> str:
    """Return a value as TOML writes it, in code; of no default nothing."""
    if value is None or value == [] or isinstance(value, dict):
        return ""
    text = f'"{value}"' if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else str(value)
    return f"`{text}`"


def clean(cell: str) -> str:
    """Return the text of a cell: on one line, without bars, with words such as load_factor as they are."""
    text = " ".join(cell.split()).replace("|", "\\|")
    parts = re.split(r"(`[^`]*`|\[\]\{[^}]*\}|\[[^\]]*\]\([^)]*\))", text)
    return "".join(part if k % 2 else re.sub(r"([*_<])", r"\\\1", part) for k, part in enumerate(parts))
