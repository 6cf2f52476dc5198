"""Numbers as text: units with prefixes, percentages, few digits."""

import math
from dataclasses import dataclass

_PREFIXES: dict[str, tuple[tuple[float, str], ...]] = {
    "m": ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")),
    "N": ((1e6, "MN"), (1e3, "kN"), (1.0, "N"), (1e-3, "mN"), (1e-6, "µN")),
    "N m": ((1e3, "kN m"), (1.0, "N m"), (1e-3, "mN m"), (1e-6, "µN m")),
    "J": ((1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"), (1e-6, "µJ"), (1e-9, "nJ")),
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")),
    "m/s^2": ((1.0, "m/s²"),),
    "Pa": ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"), (1.0, "Pa")),
}

#: Distances below this share of a displacement are rounding errors.
ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Scale:
    """A unit and its size in SI: values / size are in unit."""

    size: float
    unit: str


def natural_scale(largest: float, unit: str) -> Scale:
    """Return `unit` with the largest prefix in which `largest`, in SI, is at least 1, if the unit takes prefixes."""
    prefixes = _PREFIXES.get(unit, ((1.0, unit),))
    # The tolerance covers rounding in sums of lengths.
    fitting = [Scale(*one) for one in prefixes if abs(largest) >= one[0] * (1 - 1e-9)]
    if largest == 0 or not math.isfinite(largest):
        return Scale(1.0, unit)
    return fitting[0] if fitting else Scale(*prefixes[-1])


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """Return a value in SI as text with a prefix: 8823.5 Pa is "8.82 kPa"."""
    scale = natural_scale(value, unit)
    return f"{significant(value / scale.size, digits)} {scale.unit}".replace("-", "\N{MINUS SIGN}")


def input_quantity(value: float, unit: str) -> str:
    """Return an input value in SI as text with a prefix, with the digits of the input: 0.04 m is "40 mm"."""
    scale = natural_scale(value, unit)
    gap = "" if scale.unit == "°" else " "
    return f"{value / scale.size:.6g}{gap}{scale.unit}".replace("-", "\N{MINUS SIGN}")


def significant(value: float, digits: int) -> str:
    """Return a number with `digits` significant digits, without exponent: 123.4 with two is "120"."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    rounded = round(value, decimals)
    # Rounding may carry over: 9.96 is 10, not 10.0.
    decimals = digits - 1 - math.floor(math.log10(abs(rounded)))
    return f"{rounded:.{max(decimals, 0)}f}"


def round_factor(share: float, least: float = 0.03, aim: float = 0.12) -> float:
    """Return the factor 1, 2, 5, 10, 20, ... that brings a share below `least` closest to `aim` from below; else 1."""
    if not 0 < share < least:
        return 1.0
    power = 10.0 ** math.floor(math.log10(aim / share))
    return max(digit * power for digit in (1, 2, 5) if digit * power * share <= aim * (1 + 1e-9))


def times(factor: float) -> str:
    """Return a factor as text: 20000 is "× 20 000"."""
    return f"× {factor:,.0f}".replace(",", "\N{NO-BREAK SPACE}")


def percent(share: float) -> str:
    """Return a share as a percentage with two significant digits: 0.0214 is "2.1 %"."""
    if not math.isfinite(share):
        return "no number"
    if 0 < abs(share) < 1e-4:
        return "less than 0.01 %"
    return f"{significant(100 * share, 2)} %"


def tolerance_percent(share: float) -> str:
    """Return a tolerance as a percentage with the digits of the input: 0.05 is "5 %"."""
    return f"{100 * share:.6g} %"
