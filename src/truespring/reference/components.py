"""Names of vector components in other programs: "u", "v", "w", "Displacement 1", "disp:0", "U_x"."""

import re
from collections.abc import Iterable

#: Names of the displacement, in lower case.
DISPLACEMENTS = ("displacement", "displacements", "u", "disp", "deformation")
#: Names of positions, in lower case.
PLACES = ("points", "point", "coordinates", "coordinate", "coords", "coord", "position", "pos")

_AXES = "xyz"
_PART = re.compile(r"(?P<base>[a-z]+)[\s_:.\-]*(?P<part>[xyz]|[0-3])")
_PART_FIRST = re.compile(r"(?P<part>[xyz])[\s_:.\-]+(?P<base>[a-z]+)")


def components(names: Iterable[str], bases: Iterable[str], alone: str = "") -> dict[str, str]:
    """Find the components of a vector among names; return them by axis, such as {"x": "disp:0", "y": "disp:1"}.

    Numbered components count from 0 if one is numbered 0, else from 1.

    Args:
        names: the available names, in any spelling.
        bases: possible names of the vector, in lower case.
        alone: names of components without a base, one letter each, such as "uvw".

    Returns an empty dictionary if fewer than two axes are named, or one axis is named twice.
    """
    found: list[tuple[str, str]] = []  # component as written, and name
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
