"""What an export target is: a function that returns files, what it supports, and its options."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from truespring.exports.exported import Exported
from truespring.exports.features import Feature

#: The content of each file by its name: text, or bytes.
Files = Mapping[str, str | bytes]


@dataclass(frozen=True)
class Option:
    """An option of a target.

    Attributes:
        default: its value if it is not given; other values have the same type.
        about: one-line description.
    """

    default: bool | float | str
    about: str


def no_details(exported: Exported) -> Mapping[str, Any]:
    """Return no further values."""
    return {}


@dataclass(frozen=True)
class Target:
    """A program or format that spring models are exported to.

    Attributes:
        files: returns the files of solved springs, whose features are all in `takes`.
        about: one-line description of the files.
        program: name in error messages.
        names: names of the files; which of them are written depends on the springs.
        takes: supported features of springs and loads; any other makes `check_targets` raise ExportError.
        expressed: how springs and loads are expressed, as a sentence, for exported.json.
        left_out: what of the study is not in the files, as a sentence.
        unrun: why no test runs the program on the files; empty if a test does.
        details: returns further values of exported.json, which replace those of the same key.
        options: options by name; `files` finds their values in `Exported.options`.
    """

    files: Callable[[Exported], Files]
    about: str
    program: str
    names: tuple[str, ...]
    takes: frozenset[Feature]
    expressed: str
    left_out: str
    unrun: str = ""
    details: Callable[[Exported], Mapping[str, Any]] = no_details
    options: Mapping[str, Option] = field(default_factory=lambda: MappingProxyType({}))
