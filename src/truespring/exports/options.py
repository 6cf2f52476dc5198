"""Options of export targets, each with a name, a default and its meaning."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from truespring.errors import ExportError, nearest
from truespring.exports.target import Option, Target

#: The value of an option.
OptionValue = bool | float | str

_WORDS = {"true": True, "false": False}


def options_of(
    given: Mapping[str, OptionValue], names: Collection[str], targets: Mapping[str, Target]
) -> dict[str, dict[str, OptionValue]]:
    """Return the options of each of the targets `names`, with defaults.

    A key is that of an option, for all targets that have it, or TARGET.KEY for one. Raises ExportError for a key that
    none of the targets has, and for a value of another type than the default.
    """
    found: dict[str, dict[str, OptionValue]] = {
        name: {key: option.default for key, option in targets[name].options.items()} for name in names
    }
    for key, value in given.items():
        target, _, short = key.rpartition(".")
        takers = [name for name in found if short in found[name] and target in ("", name)]
        if not takers:
            allowed = [f"{name}.{one}" for name in found for one in found[name]]
            there = f"allowed: {', '.join(allowed)}" if allowed else "these targets have no options"
            names_of = {one: None for several in found.values() for one in several} | dict.fromkeys(allowed)
            raise ExportError(f"option '{key}' of {', '.join(names)} is unknown{nearest(key, names_of)}; {there}")
        for name in takers:
            found[name][short] = _checked(f"{name}.{short}", value, targets[name].options[short])
    return found


def _checked(key: str, value: Any, option: Option) -> OptionValue:
    """Return the value of an option; raise ExportError if it is of another type than the default."""
    if isinstance(option.default, bool) != isinstance(value, bool) or not isinstance(
        value, (int, float) if isinstance(option.default, float) else type(option.default)
    ):
        kind = {bool: "true or false", float: "a number", str: "a text"}[type(option.default)]
        raise ExportError(f"option {key} = {value!r} is not {kind}: {option.about}; default: {_shown(option.default)}")
    return type(option.default)(value)


def _shown(value: OptionValue) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def read_options(texts: Sequence[str]) -> dict[str, OptionValue]:
    """Return options by key from texts KEY=VALUE: true, false, a number, or a text. Raises ExportError for others."""
    found: dict[str, OptionValue] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not sign or not key or not value:
            raise ExportError(f"option '{text}' is not KEY=VALUE, such as contact=true or mujoco.contact=true")
        found[key.strip()] = _value(value.strip())
    return found


def _value(text: str) -> OptionValue:
    if text in _WORDS:
        return _WORDS[text]
    try:
        return float(text)
    except ValueError:
        return text
