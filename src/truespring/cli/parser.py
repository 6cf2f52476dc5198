"""The parser of the command line: verbs, options, help with examples, and suggestions for misspelt words."""

import argparse
from collections.abc import Collection, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from truespring.cli import (
    calibrate,
    check,
    compare,
    converge,
    export,
    live,
    maps,
    modes,
    moduli,
    new,
    solve,
    sweep,
    table1,
    tables,
)
from truespring.cli.printing import show
from truespring.cli.verb import Verb, add_common
from truespring.errors import nearest

#: The verbs in the order of the help, most used first.
VERBS: dict[str, Verb] = {
    verb.name: verb
    for verb in (
        new.NEW,
        check.CHECK,
        solve.VERIFY,
        solve.SOLVE,
        live.LIVE,
        moduli.MODULI,
        modes.MODES,
        converge.CONVERGE,
        compare.COMPARE,
        maps.MAP,
        calibrate.CALIBRATE,
        sweep.SWEEP,
        export.EXPORT,
        tables.RULES,
        tables.SCHEMA,
        table1.TABLE1,
    )
}

EXAMPLES = (
    "truespring new strip                  # write strip.toml, a commented study",
    "truespring check strip.toml           # show mesh, loads, supports and moduli; solve nothing",
    "truespring verify strip.toml          # solve, compare springs with FEM, write out/report.html",
    "truespring verify --help              # options and examples of a verb",
)

_Action = TypeVar("_Action", bound=argparse.Action)

SHELLS = ("bash", "zsh", "tcsh")


class Parser(argparse.ArgumentParser):
    """An argparse parser with a list of its options, for suggestions."""

    def __init__(self, **more: Any) -> None:
        self.option_names: list[str] = []
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False, **more)

    def _add_action(self, action: _Action) -> _Action:  # also called by groups of options
        self.option_names += [name for name in action.option_strings if name.startswith("--")]
        return super()._add_action(action)


class _PrintCompletion(argparse.Action):
    """Print a script by which a shell completes verbs, options and files, and exit."""

    def __call__(self, parser: argparse.ArgumentParser, _: Any, shell: Any, option: str | None = None) -> NoReturn:
        import shtab

        whole, verbs = build_parser(VERBS)
        for one in (whole, *verbs.values()):
            for action in one._actions:
                if action.type is Path or action.dest in ("study", "case", "held_out", "source"):
                    action.complete = shtab.FILE  # type: ignore[attr-defined]
        show(shtab.complete(whole, shell))
        parser.exit()


def build_parser(filled: Collection[str]) -> tuple[Parser, dict[str, Parser]]:
    """Return the parser and the parsers of the verbs; only the verbs in `filled` get their arguments."""
    parser = Parser(
        prog="truespring",
        description="Mass-spring models that match their material: solved at large deformation and compared with FEM.",
        epilog=_epilog(EXAMPLES),
    )
    parser.add_argument("--version", action="version", version=f"truespring {version('truespring')}")
    parser.add_argument(
        "--print-completion", choices=SHELLS, action=_PrintCompletion, help="print a completion script for a shell"
    )
    subparsers = parser.add_subparsers(title="verbs", dest="verb", metavar="VERB", parser_class=Parser)
    verbs = {}
    for name, verb in VERBS.items():
        one = subparsers.add_parser(
            name,
            help=verb.summary,
            description=f"{verb.summary[:1].upper()}{verb.summary[1:]}.",
            epilog=_epilog(verb.examples),
        )
        one.set_defaults(run=verb.run)
        if name in filled:
            verb.add(one)
            add_common(one, verb)
        verbs[name] = one
    return parser, verbs


def parse(arguments: Sequence[str]) -> argparse.Namespace | None:
    """Return the options of a command line; print the help and return None if it is empty.

    Exit with code 2 and a suggestion if a verb or option is wrong.
    """
    parser, verbs = build_parser(arguments)
    if not arguments:
        parser.print_help()
        return None
    first = arguments[0]
    if not first.startswith("-") and first not in VERBS:
        parser.error(f"unknown verb '{first}'{nearest(first, VERBS)}; verbs: {', '.join(VERBS)}")
    options, left = parser.parse_known_args(arguments)
    if options.verb is None:
        parser.error(f"a verb is missing; verbs: {', '.join(VERBS)}")
    if left:
        words = (f"{word}{nearest(word.partition('=')[0], verbs[options.verb].option_names)}" for word in left)
        verbs[options.verb].error(f"unrecognized arguments: {', '.join(words)}")
    return options


def _epilog(examples: Sequence[str]) -> str:
    return "\n".join(["examples:", *(f"  {one}" for one in examples)])
