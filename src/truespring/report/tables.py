"""Tables for a terminal, as rich renderables: moduli before a solve, status and errors after it."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from truespring.models import Moduli
from truespring.report.axis import axis_of
from truespring.report.parts import PartRow, part_rows
from truespring.report.quantity import natural_scale
from truespring.report.result import Result
from truespring.report.standing import own_errors
from truespring.report.supports import support_rows, support_title

if TYPE_CHECKING:
    from rich.table import Table


def moduli_line(title: str, moduli: Moduli) -> str:
    """Return the effective moduli of springs and those of the material in its section, in one line."""
    (low, high), (least, most) = moduli.young_range, moduli.poisson_range
    scale = natural_scale(high, "Pa")
    young = _span(f"{low / scale.size:.4g}", f"{high / scale.size:.4g}")
    poisson = _span(f"{least:.3f}", f"{most:.3f}")
    material = f"material {moduli.material_young / scale.size:.4g} {scale.unit}, {moduli.material_poisson:.3f}"
    return f"{title}: Young's modulus {young} {scale.unit}, Poisson's ratio {poisson} ({material})"


def _span(first: str, last: str) -> str:
    return first if first == last else f"{first} to {last}"


def moduli_table(title: str, moduli: Moduli) -> "Table":
    """Return a table of the effective moduli of springs and those of the material in its section."""
    plane = moduli.dim == 2
    # The moduli of finite elements are those of the material, except in bending on a coarse mesh.
    elements = ("four-node FEM" if plane else "eight-node FEM",) if moduli.bending else ()
    table = new_table(title, "", "springs", *elements, "material")

    def add(what: str, springs: str, material: str = "") -> None:
        table.add_row(what, springs, *[material] * (1 + len(elements)))

    young, poisson = f"{moduli.material_young:.6g}", f"{moduli.material_poisson:.4f}"
    directions = _PLANE if plane else _SPACE
    for name, along in directions.items():
        add(f"Young's modulus {name} [Pa]", f"{moduli.young(along):.6g}", young)
    for extreme, value in zip(("smallest", "largest"), moduli.young_range, strict=True):
        add(f"{extreme} Young's modulus [Pa]", f"{value:.6g}", young)
    for name in directions:
        add(f"Poisson's ratio {name}", f"{moduli.poisson(directions[name]):.4f}", poisson)
    for extreme, value in zip(("smallest", "largest"), moduli.poisson_range, strict=True):
        add(f"{extreme} Poisson's ratio", f"{value:.4f}", poisson)
    add("Zener ratio" if plane else "largest over smallest E", f"{moduli.anisotropy:.4f}", "1.0000")
    for depth, factor in moduli.bending.items():
        table.add_row(_section(moduli, depth), f"{factor:.4f}", f"{moduli.fem_bending[depth]:.4f}", "1.0000")
    add(f"patch test, unbalanced [E h{'' if plane else '^2'}]", f"{moduli.patch_score:.2g}", "0")
    add("springs", str(moduli.n_springs))
    add("springs of negative stiffness", str(moduli.n_negative))
    add("springs of no stiffness", str(moduli.n_zero))
    return table


# Directions of the moduli listed: angles from x to y [degrees], or vectors.
_PLANE: dict[str, float | tuple[int, ...]] = {"at 0 degrees": 0.0, "at 45 degrees": 45.0}
_SPACE: dict[str, float | tuple[int, ...]] = {
    "along x": (1, 0, 0),
    "along y": (0, 1, 0),
    "along z": (0, 0, 1),
    "along x + y": (1, 1, 0),
    "along x + y + z": (1, 1, 1),
}


def _section(moduli: Moduli, depth: int) -> str:
    """Return the name of a bending factor: of this mesh, or of a section with `depth` elements (squared in 3D)."""
    elements = "element" if depth == 1 else "elements"
    if depth == moduli.depth:
        return f"bending factor EI, {depth} {elements} deep (this mesh)"
    return (
        f"bending factor EI, {depth} {elements} deep" if moduli.dim == 2 else f"bending factor EI, {depth} by {depth}"
    )


def rules_table(rules: Mapping[str, Mapping[str, Any]]) -> "Table":
    """Return a table of the stiffness rules: elements, idea, effective moduli, keys and source."""
    table = new_table("Stiffness rules", "rule", "", "uses nu", "")
    for name, rule in rules.items():
        uses = "yes" if rule["follows_poisson"] else "no"
        keys = f"\nOptional keys: {', '.join(rule['parameters'])}" if rule["parameters"] else ""
        words = f"{rule['idea']}\n{rule['realises']}{keys}\nSource: {rule['source']}"
        table.add_row(name, "\n".join(rule["elements"]), uses, words, end_section=True)
    return table


def result_tables(result: Result) -> "Iterator[Table | str]":
    """Yield tables and texts: status of every model, errors, notes and warnings of a study."""
    axis = axis_of(result)
    head = axis.label if axis.moves else "load"
    table = new_table(f"{result.stem}: {result.title}", "model", "", "status", head, "iterations", "seconds")
    for name, path in result.solutions.items():
        spent = (str(path.newton_iterations), f"{path.seconds:.2f}")
        table.add_row(name, path.label, str(path.status), axis.number(path.load_factor, 6), *spent)
    yield table
    if result.comparisons:
        yield _error_table(result)
        parts = part_rows(result)
        if parts:
            yield _part_table(result, parts)
        supports = support_table(result)
        if supports is not None:
            yield supports
    for note in result.problem.mesh.notes:
        yield f"note: mesh: {note}"
    for name, path in result.solutions.items():
        for warning in path.warnings:
            yield f"warning: {name}: {warning}"


def _error_table(result: Result) -> "Table":
    forced = any(one.force_error is not None for one in result.comparisons.values())
    axis = axis_of(result)
    by = ("by",) if forced else ()
    columns = (
        "probe",
        "rms",
        "largest",
        *(("force",) if forced else ()),
        f"agrees up to{f' [{axis.unit}]' if axis.unit else ''}",
        *by,
        "own error",
    )
    table = new_table(f"'{result.model}' against", "reference", "", *columns)
    for name, one in result.comparisons.items():
        errors = (one.probe_error, one.rms_error, one.max_error, *((one.force_error,) if forced else ()))
        up_to = one.agrees_up_to_load_factor
        shown = [*map(_share, errors), "-" if up_to is None else axis.number(up_to, 6)]
        shown += [one.decided_by or "-"] if forced else []
        table.add_row(name, one.reference.label, *shown, own_errors(result, name)[0])
    return table


def _part_table(result: Result, parts: list[PartRow]) -> "Table":
    table = new_table(f"Separate errors of displacement {axis_of(result).at_full}", "error of", "", "error")
    for row in parts:
        table.add_row(row.name, row.against, f"{row.error}{', largest' if row.largest else ''}")
    return table


def support_table(result: Result) -> "Table | None":
    """Return force and torque of each moved support, of the model and of each reference; None if none is known."""
    rows = list(support_rows(result))
    if not rows:
        return None
    loaded = any(row.share_of_load for row in rows)
    columns = ("", f"'{result.model}'", "reference", "error", *(("of the load",) if loaded else ()))
    table = new_table(support_title(result), "support", *columns)
    for row in rows:
        shares = [row.share_of_load or "-"] if loaded else []
        table.add_row(row.support, f"{row.quantity}, {row.label}", row.mine, row.theirs, row.error or "-", *shares)
    return table


def _share(error: float | None) -> str:
    return "-" if error is None else f"{error:.2%}"


def new_table(title: str, *columns: str) -> "Table":
    """Return an empty table; the first column and columns without a name are aligned left, others right."""
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for number, column in enumerate(columns):
        table.add_column(column, justify="left" if number == 0 or not column else "right")
    return table
