"""The border of units: "3 kPa" becomes 3000.0; inside everything is SI float64."""

import math
import re
from functools import cache
from typing import TYPE_CHECKING, Literal

from truespring.errors import TruespringError, shown

if TYPE_CHECKING:
    import pint

Dimension = Literal["length", "stress", "force", "density", "acceleration", "moment", "angle", "stiffness"]

#: The SI unit of each dimension that a study file knows, and an example for messages.
SI_UNITS: dict[Dimension, tuple[str, str]] = {
    "length": ("m", '"160 mm"'),
    "stress": ("Pa", '"10 kPa"'),
    "force": ("N", '"-0.043 N"'),
    "density": ("kg/m^3", '"1000 kg/m^3"'),
    "acceleration": ("m/s^2", '"9.81 m/s^2"'),
    "moment": ("N m", '"20 N mm"'),
    "angle": ("rad", '"30 deg"'),
    "stiffness": ("N/m", '"5 N/mm"'),
}

#: The sizes that a quantity may have, in SI: far beyond any body, and their fourth powers are still numbers.
SMALLEST, LARGEST = 1e-30, 1e30

#: The same in words.
SIZES = f"of a size from {SMALLEST:g} to {LARGEST:g}"

# No quantity that anyone writes is longer; what is shorter is read at once.
_LONGEST = 100


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
        _ask_for_the_case(value, dimension)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    else:
        raise TruespringError(f"{shown(value)} is not a {dimension}: {allowed}")
    if not math.isfinite(number):
        raise TruespringError(f"{value!s:.40} is not finite: {allowed}")
    if number and not SMALLEST <= abs(number) <= LARGEST:
        raise TruespringError(f"{shown(value)} is out of range: {allowed}, {SIZES}")
    return number


def unit_size(unit: str | float, dimension: Dimension) -> float:
    """Return the size of a unit in SI, such as of "mm", or of "0.2 mm" where one unit is so long; a number is in SI.

    Raises TruespringError where it is no unit of the dimension, or not above 0.
    """
    written = f"1 {unit}" if isinstance(unit, str) and not unit[:1].isdigit() else unit
    size = to_si(written, dimension)
    if size <= 0:
        raise TruespringError(f"{unit!r} must be above 0")
    return size


def _ask_for_the_case(text: str, dimension: Dimension) -> None:
    """Raise TruespringError where "10 mPa" may be meant to be 10 MPa: 1e9 times as much."""
    written, meant, plain, factor = _WRONG_CASE.get(dimension, ("", "", "", 1.0))
    number, unit = _QUANTITY.fullmatch(text).groups()  # type: ignore[union-attr]  # _parse has looked
    if float(number) and unit == written:
        raise TruespringError(
            f"'{text}' is {factor * float(number):g} {plain}: is {number} {meant} meant? Upper and lower case matter; "
            f'if it is not, write "{factor * float(number):g} {plain}"'
        )


# A decimal number, then a unit: names with small powers, multiplied or divided. pint alone would take any
# arithmetic, and read "1,5 N" as 15 N and "1 000 N" as nothing.
_NAME = r"[^\W\d_]+(?:\s*(?:\^|\*\*)\s*-?\d|[²³])?"
_QUANTITY = re.compile(
    rf"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*({_NAME}(?:\s*[*/·]\s*{_NAME}|\s+{_NAME})*)?\s*"
)


# The units that studies are mostly written in: pint knows all others, and takes a third of a second to say so.
_PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "c": 1e-2, "": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}
_COMMON = {f"{prefix}{unit}": (factor, unit) for unit in ("m", "Pa", "N") for prefix, factor in _PREFIXES.items()}
_COMMON |= {unit: (1.0, unit) for unit in ("kg/m^3", "m/s^2")}
_COMMON["deg"] = (math.pi / 180, "rad")

# Units that are mostly another one in the wrong case, by dimension: what is written, what may be meant, and one
# that says the former plainly.
_WRONG_CASE: dict[Dimension, tuple[str, str, str, float]] = {
    "stress": ("mPa", "MPa", "Pa", 1e-3),
    "length": ("Mm", "mm", "km", 1e3),
}


def _parse(text: str, unit: str, allowed: str) -> float:
    if len(text) > _LONGEST:
        raise TruespringError(f"{shown(text)} has {len(text)} characters, at most {_LONGEST} are read: {allowed}")
    read = _QUANTITY.fullmatch(text)
    if read is None:
        hint = "write a decimal point, not a comma: " if "," in text else ""
        raise TruespringError(f"'{text}' cannot be read: {hint}{allowed}")
    number, unit_text = read.groups()
    if unit_text is None:
        raise TruespringError(f"'{text}' has no unit: {allowed}")
    factor, common = _COMMON.get(unit_text, (0.0, None))
    if common == unit:
        return float(number) * factor
    import pint

    try:
        return float(_registry().Quantity(float(number), unit_text).to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise TruespringError(f"'{text}' is in {error.units1}, not in {unit}: {allowed}") from None
    except pint.UndefinedUnitError:
        raise TruespringError(
            f"'{text}' has an unknown unit (upper and lower case matter{_other_case(unit_text, unit)}): {allowed}"
        ) from None
    except (pint.PintError, ArithmeticError, ValueError, TypeError) as error:  # as of degC
        raise TruespringError(f"'{text}' cannot be read: {error}: {allowed}") from None


def _other_case(text: str, unit: str) -> str:
    """Ask for a unit of the same letters in another case, the largest of several: MPa of mPa and MPa."""
    sizes = {name: size for name, (size, base) in _COMMON.items() if base == unit and name.lower() == text.lower()}
    return f", is '{max(sizes, key=lambda name: sizes[name])}' meant?" if sizes else ""
