"""Tables of load levels, and arrays over levels, nodes and components."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.comparison import most_moved
from truespring.errors import OutputError
from truespring.mesh import probe_node
from truespring.mesh.selections import AXES
from truespring.solution import Solution, State

if TYPE_CHECKING:
    import xarray


Probe = int | str | Sequence[float] | None


def columns_of(solution: Solution, probe: Probe) -> dict[str, tuple[str, list[Any]]]:
    """Return the columns of the table of load levels: unit and values, one a state, by name."""
    if not solution.states:
        raise OutputError(f"{solution.label} is a surface without load levels: it has no table")
    watched = most_moved(solution) if probe is None else probe_node(solution.problem.mesh, probe)
    rows = [_row(solution, state, watched) for state in solution.states]
    return {name: (unit, [row[name][1] for row in rows]) for name, (unit, _) in rows[0].items()}


def _row(solution: Solution, state: State, probe: int) -> dict[str, tuple[str, Any]]:
    axes = AXES[: solution.problem.mesh.dim]
    row: dict[str, tuple[str, Any]] = {"load_factor": ("-", state.load_factor)}
    if state.moving is not None:
        row["time"] = ("s", state.moving.time)
    row |= {f"u{axis}": ("m", float(u)) for axis, u in zip(axes, state.displacement[probe], strict=True)}
    row |= {f"f{axis}": ("N", float(f)) for axis, f in zip(axes, solution.applied_force(state), strict=True)}
    row["energy"] = ("J", state.energy)
    least, most = state.stretch or (np.nan, np.nan)
    row["smallest_stretch"], row["largest_stretch"] = ("-", least), ("-", most)
    row["area_ratio"] = ("-", state.area_ratio)
    row["iterations"], row["residual"] = ("-", state.iterations), ("-", state.residual)
    row["state"] = ("", state.critical or _stability(state))
    return row


def _stability(state: State) -> str:
    """Return whether a state is stable, empty if that is not known."""
    if state.negative_eigenvalues is None:
        return ""
    return "unstable" if state.negative_eigenvalues else "stable"


def table_of(solution: Solution, probe: Probe) -> Any:
    """Return the table of load levels, see `Solution.table`."""
    columns = columns_of(solution, probe)
    values = {name: entries for name, (_, entries) in columns.items()}
    try:
        import pandas
    except ImportError:
        try:
            import polars
        except ImportError:
            raise OutputError(
                "neither pandas nor polars is installed: pip install pandas; solution.write('levels.csv') needs neither"
            ) from None
        return polars.DataFrame(values)
    table = pandas.DataFrame(values)
    table.attrs["units"] = {name: unit for name, (unit, _) in columns.items()}
    return table


def arrays_of(solution: Solution) -> "xarray.Dataset":
    """Return the states as arrays, see `Solution.to_xarray`."""
    try:
        import xarray
    except ImportError:
        raise OutputError("xarray is not installed: pip install 'truespring[data]'") from None
    if not solution.states:
        raise OutputError(f"{solution.label} is a surface without load levels: it has no arrays")
    states, mesh = solution.states, solution.problem.mesh
    of_nodes, of_levels = ("level", "node", "component"), ("level",)

    def stacked(name: str) -> Any:
        return np.stack([getattr(state, name) for state in states])

    more: dict[str, Any] = {}
    if states[0].moving is not None:
        speeds = np.stack([one.moving.velocity[: mesh.n_nodes] for one in states if one.moving is not None])
        more["velocity"] = (of_nodes, speeds, {"units": "m/s"})
    times = [one.moving.time for one in states if one.moving is not None]
    return xarray.Dataset(
        {
            "displacement": (of_nodes, stacked("displacement"), {"units": "m"}),
            "reaction": (of_nodes, stacked("reaction"), {"units": "N"}),
            "applied_force": (
                ("level", "component"),
                np.stack([solution.applied_force(state) for state in states]),
                {"units": "N"},
            ),
            "energy": (of_levels, stacked("energy"), {"units": "J"}),
            **more,
        },
        coords={
            "level": np.arange(len(states)),
            "node": np.arange(mesh.n_nodes),
            "component": list(AXES[: mesh.dim]),
            **{axis: ("node", mesh.nodes[:, place], {"units": "m"}) for place, axis in enumerate(AXES[: mesh.dim])},
            "load_factor": (of_levels, stacked("load_factor"), {"units": "1"}),
            **({"time": (of_levels, np.array(times), {"units": "s"})} if more else {}),
        },
        attrs={"label": solution.label, "status": str(solution.status)},
    )
