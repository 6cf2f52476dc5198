"""Tables for a terminal, as rich renderables: moduli before a solve, status and errors after it."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from truespring.models import Moduli
from truespring.report.result import Result
from truespring.report.verdict import verdict

if TYPE_CHECKING:
    from rich.table import Table


def moduli_table(title: str, moduli: Moduli) -> "Table":
    """Return what springs realise beside what the material has in its section."""
    table = _table(title, "", "springs", "four-node FEM", "material")
    young, poisson = f"{moduli.young_wanted:.6g}", f"{moduli.poisson_wanted:.4f}"
    table.add_row("Young's modulus at 0 degrees [Pa]", f"{moduli.young():.6g}", young, young)
    table.add_row("Young's modulus at 45 degrees [Pa]", f"{moduli.young(45):.6g}", young, young)
    table.add_row("Poisson's ratio at 0 degrees", f"{moduli.poisson():.4f}", poisson, poisson)
    table.add_row("Poisson's ratio at 45 degrees", f"{moduli.poisson(45):.4f}", poisson, poisson)
    table.add_row("Zener ratio", f"{moduli.zener:.4f}", "1.0000", "1.0000")
    for depth, factor in moduli.bending.items():
        elements = "element" if depth == 1 else "elements"
        here = " (this mesh)" if depth == moduli.depth else ""
        fem = f"{moduli.fem_bending[depth]:.4f}"
        table.add_row(f"bending factor EI, {depth} {elements} deep{here}", f"{factor:.4f}", fem, "1.0000")
    return table


def result_tables(result: Result) -> "Iterator[Table | str]":
    """Yield the state of every path, the errors, the verdict and the warnings of a study."""
    table = _table(f"{result.stem}: {result.title}", "model", "", "status", "load", "iterations", "seconds")
    for name, path in result.paths.items():
        spent = (str(path.newton_iterations), f"{path.seconds:.2f}")
        table.add_row(name, path.label, str(path.status), f"{path.load_factor:.6g}", *spent)
    yield table
    if result.comparisons:
        yield _error_table(result)
    yield verdict(result)
    for name, path in result.paths.items():
        for warning in path.warnings:
            yield f"warning: {name}: {warning}"


def _error_table(result: Result) -> "Table":
    forced = any(one.force_error is not None for one in result.comparisons.values())
    columns = ("probe", "rms", "largest", *(("force",) if forced else ()), "agrees up to")
    table = _table(f"'{result.model}' against", "reference", "", *columns)
    for name, one in result.comparisons.items():
        errors = (one.probe_error, one.rms_error, one.max_error, *((one.force_error,) if forced else ()))
        shown = ("-" if error is None else f"{error:.2%}" for error in errors)
        up_to = one.agrees_up_to_load_factor
        table.add_row(name, one.reference.label, *shown, "-" if up_to is None else f"{up_to:.6g}")
    return table


def _table(title: str, *columns: str) -> "Table":
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for number, column in enumerate(columns):
        table.add_column(column, justify="left" if number == 0 or not column else "right")
    return table
