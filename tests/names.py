"""Names of tables in texts: as words of their own, so that "obj" is not found in "object"."""

import re
from collections.abc import Iterable


def words(text: str) -> set[str]:
    """All words of a text; what hyphens, underscores and slashes join is one word, and "quadratic's" is two."""
    return set(re.findall(r"[A-Za-z0-9][\w/-]*", text))


def missing(names: Iterable[str], text: str) -> set[str]:
    """The names that are no words of a text."""
    return set(names) - words(text)


def named_files(text: str) -> dict[str, str]:
    """Return the files that a page shows: fenced blocks whose first line is a comment that begins with a name."""
    blocks = re.findall(r"^```\w+\n((?:\*\*|!|<!--) (\w+\.\w+)\b.*?)^```", text, re.DOTALL | re.MULTILINE)
    return {name: content for content, name in blocks}
