"""Rows of a result as a table of polars."""

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from truespring.errors import TruespringError

if TYPE_CHECKING:
    import polars


def table_of(rows: Sequence[Mapping[str, Any]]) -> "polars.DataFrame":
    """Return rows with the same keys as a table of polars; lists and columns of mixed types become text.

    Raises TruespringError if polars is not installed.
    """
    try:
        import polars
    except ImportError:
        raise TruespringError("a table needs polars: pip install polars, or use `rows`") from None
    columns = {name: _column([row[name] for row in rows]) for name in rows[0]} if rows else {}
    return polars.DataFrame([polars.Series(name, values, kind) for name, (values, kind) in columns.items()])


def _column(values: Sequence[Any]) -> tuple[list[Any], Any]:
    import polars

    kinds = {type(value) for value in values if value is not None}
    if kinds == {bool}:
        return list(values), polars.Boolean
    if kinds == {int}:
        return list(values), polars.Int64
    if kinds and kinds <= {int, float}:
        return list(values), polars.Float64
    return [
        None if value is None else value if isinstance(value, str) else json.dumps(value) for value in values
    ], polars.String
