"""The verb `moduli`, and how effective moduli are printed."""

import argparse
from collections.abc import Iterable
from typing import TYPE_CHECKING

from truespring.cli.printing import console, print_each, print_file, reserve, writing
from truespring.cli.verb import CONVERGED, Verb, add_out, add_studies

if TYPE_CHECKING:
    from rich.console import Console

    from truespring.models import Fitness
    from truespring.study import Realised


def print_moduli(screen: "Console", stem: str, several: "Iterable[Realised]", whole: bool) -> None:
    """Print the effective moduli of springs for each material: one line, or with `whole` a table.

    Below the table, print whether the springs fit all materials and which rule fits better.
    """
    from truespring.report.tables import moduli_line, moduli_table

    for one in several:
        for title, (_, moduli) in zip(one.titles, one.by_material, strict=True):
            screen.print(moduli_table(f"{stem}: {title}", moduli) if whole else moduli_line(title, moduli))
        if one.section:
            screen.print(one.section)
        if whole:
            screen.print(f"{one.fitness.sentence}\n")
        elif not one.fitness.fit:
            screen.print(f"'{one.name}' does not fit the material{_better(one.fitness)}; -v prints the reasons")


def _better(fitness: "Fitness") -> str:
    """Return the end of a sentence that names the rule that fits better, empty without one."""
    from truespring.models.fitness import keys

    return "" if fitness.better is None else f", {keys(fitness.better)} fits better"


def _add(parser: argparse.ArgumentParser) -> None:
    add_studies(parser)
    add_out(parser)


def _run(options: argparse.Namespace) -> int:
    from truespring.study import read_studies, realised_moduli, realised_values, write_moduli

    studies = read_studies(options.study)
    reserve(options, studies)
    screen = console(options)
    values = {}
    for study in studies:
        found = list(realised_moduli(study))
        values[study.stem] = {one.name: realised_values(one) for one in found}
        print_moduli(screen, study.stem, found, whole=True)
        with writing(options.out):
            picture = write_moduli(study, found, options.out)
        if picture:
            print_file(options, "picture", picture)
        else:
            screen.print(f"{study.stem}: no springs model")
    if options.json:
        print_each(values)
    return CONVERGED


MODULI = Verb(
    "moduli",
    "show the effective moduli of springs, and which rule fits better; solves nothing",
    _add,
    _run,
    (
        "truespring moduli mesh.toml",
        "truespring moduli strip.toml block.toml --json",
    ),
)
