"""The one family of errors that truespring raises on purpose."""

import difflib
from collections.abc import Iterable


class TruespringError(Exception):
    """The input is wrong; the message names the value, where it stands and the way out."""


class StudyError(TruespringError):
    """A study file is wrong: file, key, value and what is allowed."""


class MeshError(TruespringError):
    """A mesh, a shape or a selection on a mesh is wrong."""


class ProblemError(TruespringError):
    """What is asked cannot be solved as it stands: supports, loads, material or section."""


class NoLoadError(ProblemError):
    """Nothing loads the body."""


class LoadError(ProblemError):
    """A load does not fit the body: its place among the loads, and why."""

    def __init__(self, number: int, text: str) -> None:
        super().__init__(f"loads[{number}]: {text}")
        self.number, self.text = number, text


class ModelError(TruespringError):
    """A model cannot be built for this problem: an unknown rule or law, or one that does not fit."""


class ReferenceFileError(TruespringError):
    """A result of another program cannot be read."""


class ExportError(TruespringError):
    """A target cannot express what is to be exported."""


def nearest(word: str, allowed: Iterable[str]) -> str:
    """Return `` (did you mean 'x'?)`` for the allowed word nearest to `word`, else nothing."""
    close = close_words(word, allowed)
    return f" (did you mean '{close[0]}'?)" if close else ""


def close_words(word: str, allowed: Iterable[str]) -> list[str]:
    """Return the allowed word nearest to `word` in a list of one, an empty list where none is near."""
    return difflib.get_close_matches(word, list(allowed), n=1, cutoff=0.5)


def shown(value: object, most: int = 80) -> str:
    """Return a value as Python writes it, for a message: cut in the middle where it is longer than `most`."""
    if isinstance(value, int) and abs(value) >= 10**most:  # Python refuses to write integers of thousands of digits
        return f"an integer of more than {most} digits"
    return _cut(repr(value), most)


def one_line(text: str, most: int = 1000) -> str:
    """Return a message as one line: what does not print is escaped, and it is cut in the middle beyond `most`."""
    printed = "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)
    return _cut(printed, most)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]} ... {text[-most // 4 :]}"
