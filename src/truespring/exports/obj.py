"""Wavefront OBJ: the surface at rest and at full load, or at each load level."""

from collections.abc import Mapping, Sequence

from truespring.arrays import Floats
from truespring.exports.exported import Exported
from truespring.exports.shown import Shown


def obj(exported: Exported) -> Mapping[str, str | bytes]:
    """Return rest.obj and deformed.obj, with the option `levels` also level_1.obj and so on."""
    shown = Shown(exported)
    (_, rest), *levels = shown.levels
    files = {"rest.obj": _file(shown, rest, "At rest.")}
    if levels:
        files["deformed.obj"] = _file(shown, levels[-1][1], f"At load factor {levels[-1][0]:.6g}.")
    if exported.options.get("levels", False):
        for number, (factor, places) in enumerate(levels, 1):
            files[f"level_{number}.obj"] = _file(shown, places, f"At load factor {factor:.6g}.")
    return files


def _file(shown: Shown, places: Floats, state: str) -> str:
    """Return a file; vertex i + 1 is the same node in all of them."""
    lines = [f"# {line}" for line in (*shown.exported.header, state)]
    lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in places.tolist()]
    sign = "l" if shown.is_lines else "f"
    lines += [f"{sign} {_joined(row)}" for row in (shown.rows + 1).tolist()]
    return "\n".join([*lines, ""])


def _joined(row: Sequence[int]) -> str:
    return " ".join(map(str, row))
