"""The command line that repeats a run, for pages."""

import shlex
from collections.abc import Iterable

# Options that change what is printed, not what is computed.
_ONLY_PRINTING = ("--json", "--quiet", "-q", "--verbose", "-v")


def command_line(arguments: Iterable[str]) -> str:
    """Return the command line of a run with these arguments, quoted for a shell, without options for printing."""
    return shlex.join(["truespring", *(one for one in arguments if one not in _ONLY_PRINTING)])
