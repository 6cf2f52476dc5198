"""The options of `truespring compare` for what result files do not state."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truespring.errors import StudyError, TruespringError
from truespring.reference import READERS, Placing, format_of
from truespring.units import to_si


@dataclass(frozen=True)
class FileOptions:
    """Options of a result file.

    Attributes:
        unit, axes, shift, load_factor, force_unit, full_time: see Placing; None for its defaults: m, x,y,z, no shift,
            1, no energies, and the times of the file.
        field: name of the displacement in a VTK file.
        undeformed: the undeformed body of STL or marker files with the deformed one.
        mesh: deck with the nodes of a .dat file.
    """

    unit: str | None = None
    axes: tuple[str, ...] | None = None
    shift: tuple[float, ...] | None = None
    load_factor: float | None = None
    force_unit: str | None = None
    full_time: float | None = None
    field: str | None = None
    undeformed: Path | None = None
    mesh: Path | None = None

    @property
    def placing(self) -> Placing:
        """Unit, axes, shift and load levels of the file."""
        plain = Placing()
        return Placing(
            unit=self.unit or plain.unit,
            axes=self.axes or plain.axes,
            shift=self.shift or plain.shift,
            load_factor=self.load_factor,
            force_unit=self.force_unit,
            full_time=self.full_time,
        )

    @property
    def placed(self) -> bool:
        """Whether unit, axes or shift is set."""
        return self.unit is not None or self.axes is not None or self.shift is not None


#: Names of options, each with its values on the command line.
OptionValues = Sequence[tuple[str, Sequence[str]]]

# Options of some formats only.
_BY_FORMAT = ("field", "undeformed", "mesh")


def options_of(text: str, options: OptionValues, texts: Sequence[str]) -> FileOptions:
    """Return the options of one of the sources `texts`.

    VALUE applies to all files that accept the option, FILE=VALUE to one, given by its path, name or stem. Raises
    StudyError for a FILE that matches none or several, an option that no file accepts, and an invalid VALUE.
    """
    found: dict[str, Any] = {}
    for name, values in options:
        for value in values:
            file, rest = _parts(name, value, texts)
            known = _value(name, rest, value)
            takers = [one for one in texts if _takes(one, name)]
            if not takers:
                suffixes = ", ".join(suffix for suffix in READERS if _is_for(suffix, name))
                raise StudyError(f"{_option(name)} {value}: none of the sources accepts it; it is for {suffixes} files")
            if text in takers if file is None else text == file or _names(text, file):
                found[name] = known
    return FileOptions(**found)


def _parts(name: str, value: str, texts: Sequence[str]) -> tuple[str | None, str]:
    """Return FILE, None for all files, and VALUE of an option."""
    file, equals, rest = value.partition("=")
    if not equals:
        return None, value
    named = sorted({one for one in texts if _names(one, file)})
    if not named:
        if Path(value).exists():  # a path may contain =
            return None, value
        raise StudyError(f"{_option(name)} {value}: '{file}' matches none of {', '.join(texts)}")
    taking = [one for one in named if _takes(one, name)]
    if len(taking) > 1 and file not in taking:
        raise StudyError(f"{_option(name)} {value}: '{file}' matches {' and '.join(taking)}: give the path of one")
    return file, rest


def _names(text: str, file: str) -> bool:
    place = Path(text)
    return file in (text, place.name, place.stem)


def _takes(text: str, name: str) -> bool:
    """Return whether a source accepts an option."""
    key = format_of(Path(text))
    return key is not None and _is_for(key, name)


def _is_for(key: str, name: str) -> bool:
    return name not in _BY_FORMAT or name in READERS[key].options


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _value(name: str, text: str, original: str) -> Any:
    """Return the value of an option from text; `original` is the text for messages."""
    parts = tuple(part.strip() for part in text.split(","))
    try:
        match name:
            case "axes":
                return Placing(axes=parts).axes
            case "shift":
                place = read_place(text)
                return (*place, *[0.0] * (3 - len(place)))
            case "load_factor":
                return Placing(load_factor=float(text)).load_factor
            case "full_time":
                return Placing(full_time=float(text)).full_time
            case "unit":
                return Placing(unit=text).unit
            case "force_unit":
                return Placing(force_unit=text).force_unit
            case "undeformed" | "mesh":
                return Path(text)
            case _:
                return text
    except (TruespringError, ValueError) as error:
        raise StudyError(f"{_option(name)} {original}: {error}") from None


def read_place(text: str) -> tuple[float, ...]:
    """Return a vector of two or three lengths [m] from text: "0.16, 0.02" or "160 mm, 20 mm"."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) not in (2, 3):
        raise StudyError(f"'{text}': give two or three lengths, such as 160 mm, 20 mm")
    return tuple(to_si(float(part) if _is_number(part) else part, "length") for part in parts)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
