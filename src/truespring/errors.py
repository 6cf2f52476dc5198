"""Exceptions of truespring, and helpers for their messages."""

import difflib
from collections.abc import Iterable


class TruespringError(Exception):
    """Base class: the input is wrong; the message names the value, its place and a remedy.

    Example:
        >>> import truespring as ts
        >>> try:
        ...     ts.rectangle((0.16, -0.04), (16, 4))
        ... except ts.TruespringError as error:
        ...     print(error)
        size = [0.16, -0.04]: lengths must be positive and finite
    """


class StudyError(TruespringError):
    """A study file is wrong: file, key, value and what is allowed."""


class MeshError(TruespringError):
    """A mesh, a shape or a selection on a mesh is wrong."""


class ProblemError(TruespringError):
    """A problem cannot be solved as stated: supports, loads, material or section."""


class NoLoadError(ProblemError):
    """A problem has no load."""


class LoadError(ProblemError):
    """A load does not fit the body; `number` is its index among the loads."""

    def __init__(self, number: int, text: str) -> None:
        super().__init__(f"loads[{number}]: {text}")
        self.number, self.text = number, text


class PartError(ProblemError):
    """A part of a problem is wrong; `place` is the place in a study: ("support", 0, "over"), lists count from 0."""

    def __init__(self, place: tuple[str | int, ...], text: str) -> None:
        several = len(place) > 1 and isinstance(place[1], int)
        named = [f"{place[0]}s[{place[1]}]", *place[2:]] if several else list(place)
        super().__init__(f"{'.'.join(map(str, named))}: {text}")
        self.place, self.text = place, text


class ToolError(ProblemError):
    """A tool or grasp does not fit the body; `name` is its name, `key` the wrong argument or empty."""

    def __init__(self, name: str, text: str, key: str = "") -> None:
        super().__init__(f"'{name}': {key}{': ' * bool(key)}{text}")
        self.name, self.text, self.key = name, text, key


class FibreError(ProblemError):
    """The fibres of a material have a wrong direction in a body; `fibres` are these fibres."""

    def __init__(self, fibres: object, text: str) -> None:
        super().__init__(text)
        self.fibres = fibres


class ModelError(TruespringError):
    """A model cannot be built for a problem: its rule or law is unknown or does not fit."""


class LiveError(TruespringError):
    """A live session cannot begin, or a command of it is wrong."""


class ReferenceFileError(TruespringError):
    """A result file of another program cannot be read."""


class ExportError(TruespringError):
    """A target of export cannot represent the model or its loads."""


class PluginError(TruespringError):
    """An entry of an installed package cannot be used: the package, its entry point and what is wrong."""


class OutputError(TruespringError):
    """An output folder cannot be written, or another run is writing to it."""


class OneProcessError(BaseException):
    """An exception on one of several processes, of which the others do not know: all of them have to end."""


def nearest(word: str, allowed: Iterable[str]) -> str:
    """Return `` (did you mean 'x'?)`` for the allowed word nearest to `word`, empty if none is near."""
    close = close_words(word, allowed)
    return f" (did you mean '{close[0]}'?)" if close else ""


def close_words(word: str, allowed: Iterable[str]) -> list[str]:
    """Return a list of the allowed word nearest to `word`, empty if none is near."""
    return difflib.get_close_matches(word, list(allowed), n=1, cutoff=0.5)


def shown(value: object, most: int = 80) -> str:
    """Return the `repr` of a value for a message, shortened in the middle to about `most` characters."""
    if isinstance(value, int) and abs(value) >= 10**most:  # Python does not convert integers of thousands of digits
        return f"an integer of more than {most} digits"
    return _cut(repr(value), most)


def one_line(text: str, most: int = 1000) -> str:
    """Return a message as one line: escape unprintable characters, shorten it in the middle to about `most`."""
    printed = "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)
    return _cut(printed, most)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]} ... {text[-most // 4 :]}"
