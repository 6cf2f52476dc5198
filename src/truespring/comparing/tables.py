"""Tables of two results for a terminal, as rich renderables."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from truespring.report.result import Result
from truespring.report.summary import difference
from truespring.report.tables import new_table, support_table
from truespring.report.verdict import verdict

if TYPE_CHECKING:
    from rich.table import Table


def difference_tables(result: Result) -> "Iterator[Table | str]":
    """Yield the verdict on two results, their differences at the last common load level, and warnings."""
    (one,) = result.comparisons.values()
    values = difference(result)
    table = new_table(result.title, "", "")
    table.show_header = False
    for key, what in _DIFFERENCES.items():
        if (value := values.get(key)) is not None:
            table.add_row(what, f"{value:.2%}" if key.endswith("error") else f"{value:.4g}")
    table.add_row("compared", "node by node" if one.node_by_node else "at the nodes of one, interpolated in the other")
    table.add_row("nodes", f"{len(one.outside):,}, {one.n_outside:,} outside")
    yield verdict(result)
    yield table
    supports = support_table(result)
    if supports is not None:
        yield supports
    for warning in values["warnings"]:
        yield f"warning: {warning}"


_DIFFERENCES = {
    "load_factor": "at load factor",
    "rms_error": "root-mean-square error",
    "max_error": "largest error",
    "probe_error": "error at the probe",
    "force_error": "error of the supports' force or torque",
    "energy_error": "error of the stored energy",
    "rms_distance": "root-mean-square distance [m]",
    "max_distance": "largest distance [m]",
    "surface_rms": "distance of surfaces, root mean square [m]",
    "hausdorff": "distance of surfaces, largest (Hausdorff) [m]",
}
