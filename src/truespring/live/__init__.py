"""Live sessions: a body that is pulled, pushed and cut while it moves."""

from truespring.live.session import Live as Live
