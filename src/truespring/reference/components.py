"""Names that other programs give to the parts of a vector: "u", "v", "w", "Displacement 1", "disp:0", "U_x"."""

import re
from collections.abc import Iterable

#: What the displacement is called, in small letters.
DISPLACEMENTS = ("displacement", "displacements", "u", "disp", "deformation")
#: What places are called.
PLACES = ("points", "point", "coordinates", "coordinate", "coords", "coord", "position", "pos")

_AXES = "xyz"
_PART = re.compile(r"(?P<base>[a-z]+)[\s_:.\-]*(?P<part>[xyz]|[0-3])")
_PART_FIRST = re.compile(r"(?P<part>[xyz])[\s_:.\-]+(?P<base>[a-z]+)")


def components(names: Iterable[str], bases: Iterable[str], alone: str = "") -> dict[str, str]:
    """Return which of some names is the part of a vector along each axis, by axis: {"x": "disp:0", "y": "disp:1"}.

    Parts that are counted begin at 0 where one is numbered 0, else at 1.

    Args:
        names: those that are there, in any spelling.
        bases: what the vector may be called.
        alone: names that stand for its parts without a base: "uvw".

    Returns nothing where less than two axes have a name, or one axis has several.
    """
    found: list[tuple[str, str]] = []  # the part as it is written, and the name
    for name in names:
        low = name.strip().lower()
        read = _PART.fullmatch(low) or _PART_FIRST.fullmatch(low)
        if low in alone and len(low) == 1:
            found.append((_AXES[alone.index(low)], name))
        elif read and read["base"] in bases:
            found.append((read["part"], name))
    first = 0 if any(part == "0" for part, _ in found) else 1
    by_axis: dict[str, str] = {}
    for part, name in found:
        place = int(part) - first if part.isdigit() else _AXES.index(part)
        if place > 2 or _AXES[place] in by_axis:
            return {}
        by_axis[_AXES[place]] = name
    return by_axis if len(by_axis) >= 2 and {"x", "y"} <= by_axis.keys() else {}
