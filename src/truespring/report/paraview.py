"""A script that opens results in ParaView, deformed.

Source: "paraview.simple Module", https://www.paraview.org/paraview-docs/latest/python/paraview.simple.html
"""

from collections.abc import Mapping
from importlib.resources import files

#: The name of the script in the folder of the results.
NAME = "open_in_paraview.py"


def paraview_script(names: Mapping[str, str], shown: str, vectors: str, flat: bool) -> str:
    """Return a Python state of ParaView that warps series by a field.

    Args:
        names: the file of each series by its name, in the folder of the script.
        shown: the name of the series that is visible at first.
        vectors: the field of the points that is added to them.
        flat: whether the bodies are in the plane z = 0.
    """
    text = (files("truespring.report") / f"{NAME}.in").read_text(encoding="utf-8")
    values = {"NAMES": dict(names), "SHOWN": shown, "VECTORS": vectors, "FLAT": flat}
    for key, value in values.items():
        text = text.replace(f"{{{key}}}", repr(value))
    return text
