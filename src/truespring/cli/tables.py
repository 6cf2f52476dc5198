"""The verbs `rules` and `schema`: list the stiffness rules and the keys of a study."""

import argparse

from truespring.cli.printing import console, print_json
from truespring.cli.verb import CONVERGED, Verb


def _add(parser: argparse.ArgumentParser) -> None:
    """Add no arguments."""


def _rules(options: argparse.Namespace) -> int:
    from truespring.report.tables import rules_table
    from truespring.study import rule_values

    rules = rule_values()
    console(options).print(rules_table(rules))
    if options.json:
        print_json(rules)
    return CONVERGED


def _schema(options: argparse.Namespace) -> int:
    from truespring.study.schema import StudyKeys

    print_json(StudyKeys.model_json_schema())
    return CONVERGED


RULES = Verb(
    "rules",
    "list the stiffness rules: effective moduli, elements and source",
    _add,
    _rules,
    ("truespring rules", "truespring rules --json"),
    ("json",),
)

SCHEMA = Verb(
    "schema",
    "print the JSON Schema of study files, which describes every key",
    _add,
    _schema,
    ("truespring schema", "truespring schema > study.schema.json"),
    (),
)
