"""The sources of rules and laws, from their tables."""

from truespring.models import LAWS, RULES


def rule_sources() -> str:
    """Return a table of the sources of rules and laws, as markdown."""
    lines = ["| rule or law | source |", "|---|---|"]
    for table in (RULES, LAWS):
        lines += [f"| `{name}` | {one.source} |" for name, one in table.items()]
    return "\n".join(lines)
