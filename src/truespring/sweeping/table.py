"""The tidy table of a sweep: one row per point, one column per varied key and per number of the summary."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from truespring.report.rows import table_of

# Values of each model, and of each comparison, that are columns; vectors have one column per direction.
_OF_MODELS = (
    "status",
    "load_factor",
    "probe_displacement",
    "largest_probe_displacement",
    "force",
    "energy",
    "residual",
    "smallest_area_ratio",
    "newton_iterations",
    "n_nodes",
    "n_unknowns",
    "seconds",
    "warnings",
)
_OF_MODULI = ("young", "poisson", "anisotropy")
_OF_COMPARISONS = (
    "probe_error",
    "rms_error",
    "max_error",
    "force_error",
    "decided_by",
    "agrees_up_to_load_factor",
)
_VECTORS = ("probe_displacement", "force")


def rows_of(keys: Sequence[str], records: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one row per record, sorted by the varied keys; all have the same columns, None without a value."""
    rows = [_row(keys, record) for record in records]
    rows.sort(key=lambda row: [_rank(row[key]) for key in keys])
    columns: dict[str, None] = {}
    for row in rows:
        columns.update(dict.fromkeys(row))
    ordered = [*keys, *_gathered(column for column in columns if column not in keys)]
    return [{column: row.get(column) for column in ordered} for row in rows]


def _row(keys: Sequence[str], record: Mapping[str, Any]) -> dict[str, Any]:
    summary = record["summary"] or {"models": {}, "comparison": {}, "closest": None}
    row = {key: record["values"][key] for key in keys}
    row |= {"status": record["status"], "reason": record["reason"], "closest": summary["closest"]}
    for name, model in summary["models"].items():
        row.update(_columns(f"models.{name}", model, _OF_MODELS))
        if "moduli" in model:
            row.update(_columns(f"models.{name}", model["moduli"], _OF_MODULI))
    for name, comparison in summary["comparison"].items():
        row.update(_columns(f"comparison.{name}", comparison, _OF_COMPARISONS))
    return row


def _columns(prefix: str, values: Mapping[str, Any], names: Sequence[str]) -> Iterator[tuple[str, Any]]:
    for name in names:
        value = values.get(name)
        if name in _VECTORS:
            for axis, component in zip("xyz", value or (), strict=False):
                yield f"{prefix}.{name}.{axis}", component
        elif name in values:
            yield f"{prefix}.{name}", "; ".join(value or ()) if name == "warnings" else value


def _gathered(columns: Iterable[str]) -> list[str]:
    """Return columns in their first order, with those of one model or comparison next to each other."""
    names = list(columns)
    first: dict[str, int] = {}
    for place, name in enumerate(names):
        first.setdefault(_group(name), place)
    return sorted(names, key=lambda name: first[_group(name)])


def _group(column: str) -> str:
    parts = column.split(".")
    return ".".join(parts[:2]) if parts[0] in ("models", "comparison") and len(parts) > 2 else column


def _rank(value: Any) -> tuple[int, Any]:
    """Return the sort key of a value: numbers before lists before texts before missing values."""
    if isinstance(value, int | float):
        return 0, value
    if isinstance(value, list):
        return 1, [_rank(one) for one in value]
    return (3, "") if value is None else (2, str(value))


def write_table(rows: Sequence[Mapping[str, Any]], folder: Path) -> None:
    """Write sweep.csv and sweep.parquet into a folder."""
    table = table_of(rows)
    table.write_parquet(folder / "sweep.parquet")
    table.write_csv(folder / "sweep.csv")
