"""docs/table1.md: the measured and the printed table, and a sentence for each difference."""

from collections.abc import Iterator, Mapping
from typing import Any

from truespring.table1.bodies import POISSON
from truespring.table1.entries import CRITERIA, METHODS, PRINTED
from truespring.table1.measures import RATIOS
from truespring.table1.run import sizes
from truespring.table1.signs import IF, MEANING, Row, contradictions, sign


def page(table: Mapping[str, Any], figures: Mapping[int, str]) -> str:
    """Return the page of a measured table as Markdown; `figures` are the paths of figures by dimension."""
    return "\n".join(_lines(table, figures)) + "\n"


def _lines(table: Mapping[str, Any], figures: Mapping[int, str]) -> Iterator[str]:
    rows: list[Row] = table["rows"]
    machine = table["machine"]
    yield "# Table 1 of Lembryk and Ciszkiewicz, measured"
    yield ""
    yield (
        "The published table rates six methods by signs. Here, all methods solve the same problem with the same "
        "solver, and each sign follows from a measured value. The body is a cantilever four times as long as deep, "
        "with a transverse dead load at its end; Poisson's ratio is 1/3 in 2D (plane stress) and 1/4 in 3D. The "
        "reference is finite elements of second order. This page is written by `truespring table1`."
    )
    yield ""
    for dim in sorted({row["dim"] for row in rows}):
        yield from _of_dim(rows, dim, figures[dim])
    yield "## Measures"
    yield ""
    yield from _definitions(table)
    yield ""
    yield (
        f"Measured {table['measured']} in {table['seconds'] / 60:.0f} minutes on {machine['cores']} cores of "
        f"{machine['processor']}, truespring {table['truespring']}, Python {machine['python']}, "
        f"NumPy {machine['numpy']}, SciPy {machine['scipy']}, Numba {machine['numba']}. The sources of each method are "
        "listed in [models.md](models.md)."
    )


def _of_dim(rows: list[Row], dim: int, figure: str) -> Iterator[str]:
    yield f"## {dim}D"
    yield ""
    yield f"![Four measures of each method]({figure})"
    yield ""
    chief = {row["method"]: row for row in rows if row["dim"] == dim and row["chief"]}
    yield (
        "Each cell has the printed and the measured sign of the entry in bold below, as printed : measured. "
        "Differences are in bold."
    )
    yield ""
    yield "| | " + " | ".join(METHODS) + " |"
    yield "|---" * (1 + len(METHODS)) + "|"
    for criterion in CRITERIA:
        cells = []
        for method, printed in zip(METHODS, PRINTED[criterion], strict=True):
            measured = sign(criterion, chief[method], chief["FEM"]) if method in chief and "FEM" in chief else "?"
            cells.append(f"{printed} : {measured}" if printed == measured else f"**{printed} : {measured}**")
        yield f"| {criterion} | " + " | ".join(cells) + " |"
    yield ""
    yield from _figures(rows, dim)
    found = contradictions(rows, dim)
    if found:
        yield "Differences, and the conditions under which the printed sign would apply:"
        yield ""
        for criterion, method, printed, measured in found:
            reason = IF.get((criterion, method), "")
            signs = f"printed {printed}, measured {measured}"
            yield f"* {method}, {criterion}: {signs}. The sign {printed} would apply {reason}"
        yield ""


def _figures(rows: list[Row], dim: int) -> Iterator[str]:
    heads = ["solve [ms]", "force [ms]"]
    heads += ["1 % from, in [ms]"] if dim == 2 else []
    own = "1/3" if dim == 2 else "1/4"
    heads += [f"error of moduli at ν = 0, {own}, 0.45", "small load", "fine mesh", "within 5 % up to"]
    yield "| method | " + " | ".join(heads) + " |"
    yield "|---" * (1 + len(heads)) + "|"
    for row in rows:
        if row["dim"] != dim:
            continue
        name = f"{row['method']}: {row['name']}"
        cells = [_time(row), _number(row.get("force_ms"), 3)]
        if dim == 2:
            depth = row.get("depth_to_1_percent")
            cells.append("never" if depth is None else f"{depth} deep, {_number(row['ms_to_1_percent'], 2)}")
        cells.append(_moduli(row))
        cells += [_percent(row.get("small_error")), _percent(row.get("small_limit"))]
        cells.append(_reach(row))
        yield f"| {f'**{name}**' if row['chief'] else name} | " + " | ".join(cells) + " |"
    yield ""
    refused = [(row, text) for row in rows if row["dim"] == dim for text in row["refused"]]
    for row, text in refused:
        yield f"* {row['method']}, {row['name']}: {text}"
    if refused:
        yield ""


def _time(row: Row) -> str:
    if row.get("solve_ms") is None:
        return "no stable state"
    steps = f", {row['load_steps']} steps" if row["load_steps"] != 1 else ""
    setup = f" ({_number(row['setup_ms'], 2)} for the setup)" if row["setup_ms"] > 0.2 * row["solve_ms"] else ""
    return f"{_number(row['solve_ms'], 2)}{steps}{setup}"


def _moduli(row: Row) -> str:
    errors = {one["poisson"]: one["error"] for one in row.get("moduli_errors", [])}
    return ", ".join(_percent(errors.get(ratio)) for ratio in (RATIOS[0], POISSON[row["dim"]], RATIOS[-1]))


def _reach(row: Row) -> str:
    if row.get("deflection_within_5_percent") is None:
        return "–"
    ended = {"the error": "", "the largest load": ", the largest tried"}.get(
        row["ended_by"], f", then {row['ended_by']}"
    )
    return f"{row['deflection_within_5_percent']:.2f} L{ended}"


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}g}" if value < 10**digits else f"{value:.0f}"


def _percent(value: float | None) -> str:
    if value is None:
        return "–"
    return "0" if value < 1e-9 else f"{100 * value:.2g} %"


def _definitions(table: Mapping[str, Any]) -> Iterator[str]:
    for dim in (2, 3):
        mesh = {name: size.words for name, size in sizes(dim).items()}
        known = [one for one in table["references"] if one["dim"] == dim]
        if known:
            (one,) = known
            yield (
                f"* In {dim}D, on {mesh['speed']} elements (solve, force, large deflection), {mesh['accuracy']} (small "
                f"load) and {mesh['limit']} (fine mesh); reference: {one['elements']:,} "
                f"{'triangles' if dim == 2 else 'tetrahedra'} of second order with {one['n_nodes']:,} nodes."
            )
    yield "* solve: time from the mesh to the equilibrium at a deflection of half the length, best of three."
    yield "* force: time of one evaluation of the internal force there."
    yield (
        "* 1 % from: the coarsest mesh such that it and all finer ones, up to 32 elements deep, have an error of the "
        "end displacement below 1 % at small load, and the time of its solve."
    )
    yield (
        "* error of moduli: relative difference between the elasticity matrix for uniform strains and that of the "
        "material, in the Frobenius norm."
    )
    yield "* small load, fine mesh: root-mean-square nodal error there at a deflection of 0.0067 of the length."
    yield (
        "* within 5 % up to: the largest deflection, through stable states only, up to which the displacement of the "
        "end differs from neo-Hookean FEM by at most 5 %."
    )
    yield ""
    yield "Signs:"
    yield ""
    for criterion, meaning in MEANING.items():
        yield f"* {criterion}: {meaning}."
