"""What the loop of a session needs of a reference that follows it, and of what measures its errors."""

from collections.abc import Sequence
from typing import Any, Protocol

from truespring.live.commands import Command
from truespring.live.ring import Ring


class Companion(Protocol):
    """A reference that follows a session in another process.

    Attributes:
        notes: what happened since they were cleared, in sentences.
    """

    notes: list[str]

    def tell(self, command: Command) -> None:
        """Take a command of the session."""
        ...

    def frames(self, n: int, still: bool) -> None:
        """Take the number of frames of the session, and whether it is held still."""
        ...

    def news(self) -> Sequence[Any]:
        """Return the states that are known since the last call; never block."""
        ...

    def close(self) -> None:
        """End the process."""
        ...


class Gauge(Protocol):
    """Measures the errors of a session."""

    def take(self, ghost: Any, ring: Ring) -> None:
        """Compare a state of the companion with the session at the same time."""
        ...

    def words(self) -> dict[str, str]:
        """Return the errors that are known, as text by "model", "time" and "solver"."""
        ...
