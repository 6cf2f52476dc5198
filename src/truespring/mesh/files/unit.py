"""The unit of length of a file that states none."""

from pathlib import Path

from truespring.errors import MeshError, TruespringError
from truespring.units import unit_size


def length_unit(unit: str | float, file: str | Path) -> float:
    """Return a file's unit of length [m]; raise MeshError, with the file, where it is none."""
    try:
        return unit_size(unit, "length")
    except TruespringError as error:
        raise MeshError(f"{file}: unit: {error}") from None
