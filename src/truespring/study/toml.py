"""Write the tables of a study as TOML."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any


def toml_text(tables: Mapping[str, Any]) -> str:
    """Return the TOML text of tables as tomllib reads them; tables and lists of tables get headers."""
    return "\n".join(_tables(tables, "")).lstrip("\n") + "\n"


def _tables(table: Mapping[str, Any], name: str) -> Iterator[str]:
    """Yield the lines of a table called `name`: first keys with plain values, then tables under their headers."""
    own = {key: value for key, value in table.items() if not _has_header(value, name)}
    for key, value in own.items():
        yield f"{_key(key)} = {_value(value)}"
    for key, value in table.items():
        if key in own:
            continue
        whole = f"{name}.{_key(key)}" if name else _key(key)
        for one in value if isinstance(value, list) else [value]:
            if not isinstance(value, list) and one and all(isinstance(inner, Mapping) for inner in one.values()):
                yield from _tables(one, whole)  # a table that holds only tables needs no header
                continue
            yield f"\n[[{whole}]]" if isinstance(value, list) else f"\n[{whole}]"
            yield from (f"{_key(inner)} = {_value(what)}" for inner, what in one.items())


def _has_header(value: Any, name: str) -> bool:
    """Return whether a value in table `name` is written under a header: tables, and lists of tables at the top."""
    tables = isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value)
    return isinstance(value, Mapping) or (not name and bool(tables))


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)


def _value(value: Any) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
        case Mapping():
            inner = ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items())
            return f"{{ {inner} }}" if inner else "{}"
        case list():
            return f"[{', '.join(map(_value, value))}]"
    return repr(value)
