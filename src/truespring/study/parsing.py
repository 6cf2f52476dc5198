"""Read a study file and parse its TOML; keys are checked later."""

import io
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from truespring.errors import StudyError, one_line
from truespring.opening import read_file
from truespring.study.places import line_numbers, place_of

# Limit on nested tables and lists; studies use at most four levels.
_DEEPEST = 20
_TOO_DEEP = f"lists and tables are nested more than {_DEEPEST} deep: no key of a study allows that"
# Limit on dots in a key or a list: the time of tomllib grows with the square of the number of dots in a key.
_MOST_DOTS = 100


def parse(file: Path) -> tuple[str, dict[str, Any]]:
    """Return the text of a study file and its parsed TOML; raise StudyError if it cannot be read or parsed."""
    try:
        source = io.StringIO(read_file(file, StudyError).decode("utf-8-sig"), newline=None).read()
    except UnicodeDecodeError:
        raise StudyError(f"{file}: is not a text file in UTF-8: a study is a TOML file") from None
    _check_dots(file, source)
    try:
        document = tomllib.loads(source)
    except RecursionError:
        raise StudyError(f"{file}: {_TOO_DEEP}") from None
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{file}: is not valid TOML: {one_line(str(error))}") from None
    except ValueError as error:
        raise StudyError(_value_error(file, source, error)) from None
    _check_depth(file, document)
    return source, document


def _value_error(file: Path, source: str, error: ValueError) -> str:
    """Return a message that names the key of an integer of thousands of digits, which Python cannot convert."""
    for number, line in enumerate(source.splitlines(), 1):
        if re.search(r"\d[\d_]{999}", line):
            keys = [key for key, at in line_numbers(source).items() if at == number]
            place = place_of(file, keys[0], {keys[0]: number}) if keys else f"{file}:{number}"
            return f"{place}: an integer of thousands of digits is not allowed"
    return f"{file}: is not valid TOML: {one_line(str(error))}"


def _check_dots(file: Path, source: str) -> None:
    for number, line in enumerate(source.splitlines(), 1):
        if any(part.count(".") > _MOST_DOTS for part in line.split("=")):
            raise StudyError(
                f"{file}:{number}: more than {_MOST_DOTS} dots: no key and no list of a study is that long"
            )


def _check_depth(file: Path, document: Mapping[str, Any]) -> None:
    """Raise StudyError if lists and tables are nested deeper than _DEEPEST; later code recurses over them."""
    held: list[Any] = [document]
    for _ in range(_DEEPEST):
        held = [
            inner
            for one in held
            for inner in (one.values() if isinstance(one, Mapping) else one)
            if isinstance(inner, Mapping | list)
        ]
    if held:
        raise StudyError(f"{file}: {_TOO_DEEP}")
