"""The border of units: "3 kPa" becomes 3000.0; inside everything is SI float64."""

import math
from functools import cache
from typing import TYPE_CHECKING, Literal

from truespring.errors import TruespringError

if TYPE_CHECKING:
    import pint

Dimension = Literal["length", "stress", "force", "density"]

#: The SI unit of each dimension that a study file knows, and an example for messages.
SI_UNITS: dict[Dimension, tuple[str, str]] = {
    "length": ("m", '"160 mm"'),
    "stress": ("Pa", '"10 kPa"'),
    "force": ("N", '"-0.043 N"'),
    "density": ("kg/m^3", '"1000 kg/m^3"'),
}


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint  # a third of a second: only where a unit is written

    return pint.UnitRegistry()


def to_si(value: object, dimension: Dimension) -> float:
    """Convert a number (taken as SI) or a text with its unit to SI.

    Raises TruespringError for a text without or with an unknown unit, a unit of another
    dimension, a value that is no number, NaN and infinity.
    """
    unit, example = SI_UNITS[dimension]
    allowed = f"a {dimension} is wanted, as a number in {unit} or a text with a unit such as {example}"
    if isinstance(value, str):
        number = _parse(value, unit, allowed)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        number = float(value)
    else:
        raise TruespringError(f"{value!r} is not a {dimension}: {allowed}")
    if not math.isfinite(number):
        raise TruespringError(f"{value!r} is not finite: {allowed}")
    return number


def _parse(text: str, unit: str, allowed: str) -> float:
    import pint

    try:
        quantity: pint.Quantity[float] = _registry().Quantity(text)
        return float(quantity.to(unit).magnitude)
    except pint.DimensionalityError as error:
        found = "has no unit" if str(error.units1) == "dimensionless" else f"is in {error.units1}, not in {unit}"
        raise TruespringError(f"'{text}' {found}: {allowed}") from None
    except pint.UndefinedUnitError:
        raise TruespringError(f"'{text}' has an unknown unit (upper and lower case matter): {allowed}") from None
    except Exception:  # pint passes on whatever its parser met: tokenize, arithmetic, attribute errors
        raise TruespringError(f"'{text}' cannot be read: {allowed}") from None
