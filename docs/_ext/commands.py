"""The verbs of the command line, from their parsers."""

import argparse
import re
from collections.abc import Iterator

from truespring.cli.parser import VERBS, build_parser


def commands() -> str:
    """Return all verbs as markdown: what each does, its usage, arguments, options and examples."""
    _, verbs = build_parser(VERBS)
    return "\n".join(line for name, parser in verbs.items() for line in verb(name, parser))


def verb(name: str, parser: argparse.ArgumentParser) -> Iterator[str]:
    """Yield the lines of a verb."""
    yield from ("", f"(verb-{name})=", f"## {name}", "", *described(parser.description or ""), "")
    yield from ("```text", parser.format_usage().removeprefix("usage: ").rstrip(), "```", "")
    shown = [action for action in parser._actions if action.help != argparse.SUPPRESS]
    if shown:
        yield from ("| argument | meaning |", "|---|---|")
        yield from (f"| {names(action)} | {escaped(action.help or '')} |" for action in shown)
    examples = (VERBS[name].examples,)
    yield from ("", "Examples:", "", "```sh", *(line for lines in examples for line in lines), "```", "")


def described(text: str) -> Iterator[str]:
    """Yield the description of a verb; indented lines of a name and its text as a list."""
    for part in re.split(r"\n\s*\n", text.strip()):
        rows = re.findall(r"^ +(\S+) {2,}(.*)$", part, re.MULTILINE)
        yield from (escaped(part.partition("\n")[0] if rows else part), "")
        yield from (f"* `{name}`: {escaped(meaning)}" for name, meaning in rows)
        yield ""


def names(action: argparse.Action) -> str:
    """Return the names of an argument with what follows them."""
    value = action.metavar or (action.dest.upper() if action.nargs != 0 else "")
    value = " ".join(value) if isinstance(value, tuple) else value
    if not action.option_strings:
        return f"`{action.metavar or action.dest}`"
    if action.choices is not None and not action.metavar:
        value = "{" + ",".join(str(choice) for choice in action.choices) + "}"
    spaced = f" {value}" if value and action.nargs != 0 else ""
    return ", ".join(f"`{option}{spaced}`" for option in action.option_strings)


def escaped(text: str) -> str:
    """Return the text for a cell of a table."""
    text = " ".join(text.replace("%%", "%").split())
    for sign in "*_<|":
        text = text.replace(sign, f"\\{sign}")
    return text
