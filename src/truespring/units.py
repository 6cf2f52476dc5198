"""Convert quantities with units to SI: "3 kPa" becomes 3000.0. All other modules use SI units."""

import math
import re
from functools import cache
from typing import TYPE_CHECKING, Literal

from truespring.errors import TruespringError, shown

if TYPE_CHECKING:
    import pint

Dimension = Literal[
    "length",
    "stress",
    "force",
    "density",
    "acceleration",
    "moment",
    "angle",
    "stiffness",
    "stiffness per area",
    "time",
    "rate",
    "speed",
    "mass",
]

#: The SI unit of each dimension, and an example for error messages.
SI_UNITS: dict[Dimension, tuple[str, str]] = {
    "length": ("m", '"160 mm"'),
    "stress": ("Pa", '"10 kPa"'),
    "force": ("N", '"-0.043 N"'),
    "density": ("kg/m^3", '"1000 kg/m^3"'),
    "acceleration": ("m/s^2", '"9.81 m/s^2"'),
    "moment": ("N m", '"20 N mm"'),
    "angle": ("rad", '"30 deg"'),
    "stiffness": ("N/m", '"5 N/mm"'),
    "stiffness per area": ("N/m^3", '"5 N/mm^3"'),
    "time": ("s", '"20 ms"'),
    "rate": ("1/s", '"2 1/s"'),
    "speed": ("m/s", '"30 mm/s"'),
    "mass": ("kg", '"20 g"'),
}

#: Limits on the magnitude of nonzero quantities in SI units; their fourth powers do not overflow.
SMALLEST, LARGEST = 1e-30, 1e30

#: The limits as text, for error messages.
SIZES = f"of a size from {SMALLEST:g} to {LARGEST:g}"

# Limit on the length of a quantity, so that the regular expression stays fast.
_LONGEST = 100


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint  # slow: imported only for units that are not in _COMMON

    return pint.UnitRegistry()


def to_si(value: object, dimension: Dimension) -> float:
    """Convert a number in SI units, or a string with a unit, to a float in SI units.

    Raises TruespringError for a missing or unknown unit, a unit of another dimension, a value that is not a finite
    number, and a magnitude outside SMALLEST to LARGEST.
    """
    unit, example = SI_UNITS[dimension]
    allowed = f"must be a number in {unit} or a string with a unit of {dimension} such as {example}"
    if isinstance(value, str):
        number = _parse(value, unit, allowed)
        _check_case(value, dimension)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    else:
        raise TruespringError(f"{shown(value)} is not a quantity: {allowed}")
    if not math.isfinite(number):
        raise TruespringError(f"{value!s:.40} is not finite: {allowed}")
    if number and not SMALLEST <= abs(number) <= LARGEST:
        raise TruespringError(f"{shown(value)} is out of range: {allowed}, {SIZES}")
    return number


def unit_size(unit: str | float, dimension: Dimension) -> float:
    """Return a unit in SI units: 0.001 for "mm"; a unit may have a factor, as "0.2 mm", or be a number in SI units.

    Raises TruespringError if the unit does not have the dimension or is not positive.
    """
    written = f"1 {unit}" if isinstance(unit, str) and not unit[:1].isdigit() else unit
    size = to_si(written, dimension)
    if size <= 0:
        raise TruespringError(f"{unit!r} must be positive")
    return size


def _check_case(text: str, dimension: Dimension) -> None:
    """Raise TruespringError for units of _WRONG_CASE: "10 mPa" may be meant to be 10 MPa, 1e9 times as much."""
    written, meant, plain, factor = _WRONG_CASE.get(dimension, ("", "", "", 1.0))
    number, unit = _QUANTITY.fullmatch(text).groups()  # type: ignore[union-attr]  # _parse checks this
    if float(number) and unit == written:
        raise TruespringError(
            f"'{text}' is {factor * float(number):g} {plain}: is {number} {meant} meant? Units are case sensitive; "
            f'otherwise write "{factor * float(number):g} {plain}"'
        )


def unit_of(unit: str | float, dimension: Dimension, key: str, error: type[TruespringError]) -> float:
    """Return `unit_size`; raise `error`, with the key and the unit, if it is not a unit of the dimension."""
    try:
        return unit_size(unit, dimension)
    except TruespringError as found:
        raise error(f"{key} = {shown(unit)}: {found}") from None


# A decimal number, then a product or quotient of unit names with small powers. pint alone would evaluate any
# expression, and would read "1,5 N" as 15 N. "2 1/s" is a rate.
_NAME = r"[^\W\d_]+(?:\s*(?:\^|\*\*)\s*-?\d|[²³])?"
_QUANTITY = re.compile(
    rf"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
    rf"((?:(?<=\s)1\s*/\s*)?{_NAME}(?:\s*[*/·]\s*{_NAME}|\s+{_NAME})*)?\s*"
)


# Common units, which are converted without importing pint; pint converts all others.
_PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "c": 1e-2, "": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}
_COMMON = {f"{prefix}{unit}": (factor, unit) for unit in ("m", "Pa", "N", "s") for prefix, factor in _PREFIXES.items()}
_COMMON |= {unit: (1.0, unit) for unit in ("kg/m^3", "m/s^2", "m/s")}
_COMMON["mm/s"] = (1e-3, "m/s")
_COMMON["deg"] = (math.pi / 180, "rad")

# Units that are probably misspelt by case, by dimension: the unit, the unit that may be meant, and an unambiguous unit
# for the former with the factor to it.
_WRONG_CASE: dict[Dimension, tuple[str, str, str, float]] = {
    "stress": ("mPa", "MPa", "Pa", 1e-3),
    "length": ("Mm", "mm", "km", 1e3),
}


def _parse(text: str, unit: str, allowed: str) -> float:
    """Return a string with a unit as a number in the SI unit `unit`; error messages end with `allowed`."""
    if len(text) > _LONGEST:
        raise TruespringError(f"{shown(text)} has {len(text)} characters, at most {_LONGEST} are allowed: {allowed}")
    read = _QUANTITY.fullmatch(text)
    if read is None:
        hint = "use a decimal point, not a comma: " if "," in text else ""
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
            f"'{text}' has an unknown unit (units are case sensitive{_other_case(unit_text, unit)}): {allowed}"
        ) from None
    except (pint.PintError, ArithmeticError, ValueError, TypeError) as error:  # such as degC
        raise TruespringError(f"'{text}' cannot be read: {error}: {allowed}") from None


def _other_case(text: str, unit: str) -> str:
    """Return a question after a unit with the same letters in another case: the largest, MPa rather than mPa."""
    sizes = {name: size for name, (size, base) in _COMMON.items() if base == unit and name.lower() == text.lower()}
    return f", is '{max(sizes, key=lambda name: sizes[name])}' meant?" if sizes else ""
