"""The verb `check`: check a study and print its mesh, loads, supports and moduli."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truespring.cli.moduli import print_moduli
from truespring.cli.printing import console, print_each, print_file, reserve, say, writing
from truespring.cli.verb import CONVERGED, Verb, add_studies
from truespring.errors import OutputError

if TYPE_CHECKING:
    from rich.console import Console

    from truespring.study import Study


def _add(parser: argparse.ArgumentParser) -> None:
    add_studies(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for the picture of supports and loads, default: out if it can be written; none with --quiet "
        "or --json",
    )


def _run(options: argparse.Namespace) -> int:
    from truespring.study import plan, read_studies, realised_moduli

    studies = read_studies(options.study)
    screen = console(options)
    required = options.out is not None
    drawn = required or not screen.quiet
    if required:
        reserve(options, studies)
    else:
        options.out = Path("out")
    plans = {study.stem: plan(study) for study in studies}
    for study in studies:
        _print_plan(screen, plans[study.stem])
        if not screen.quiet:
            print_moduli(screen, study.stem, realised_moduli(study), options.verbose)
        if drawn:
            _draw(options, study, required)
    if options.json:
        print_each(plans)
    return CONVERGED


def _draw(options: argparse.Namespace, study: "Study", required: bool) -> None:
    """Write the picture of a study and print its path.

    If its folder cannot be written, raise OutputError for a `required` picture; else print a note.
    """
    from truespring.study.picture import write_picture

    try:
        if not required:  # else the folder was reserved before
            reserve(options, [study])
        with writing(options.out):
            picture = write_picture(study, options.out)
    except OutputError as error:
        if required:
            raise
        say(f"note: {study.stem}: no picture: {error}")
    else:
        print_file(options, "picture", picture)


def _fibre_words(material: dict[str, Any]) -> str:
    from truespring.fibres import Fibres

    fibres = material.get("fibres")
    return f", {Fibres(**fibres).words()}" if fibres else ""


def _print_plan(screen: "Console", plan: dict[str, Any]) -> None:
    """Print the plan of a study as lines of text."""
    held = ", ".join(f"{count} along {axis}" for axis, count in plan["held"].items())
    material, section = plan["material"], plan["section"]
    size = " by ".join(f"{extent:g} m" for extent in plan["size"])
    across = f", {section['kind']}, thickness {section['thickness']:g} m" if section else ""
    screen.print(f"{plan['title']}\n{size}{across}")
    if material:
        fibres = _fibre_words(material)
        screen.print(f"Young's modulus {material['young']:g} Pa, Poisson's ratio {material['poisson']:g}{fibres}")
    for region in plan["regions"]:
        fibres = _fibre_words(region)
        screen.print(f"  in {region['n_elements']} elements {region['young']:g} Pa and {region['poisson']:g}{fibres}")
    screen.print(f"{plan['n_nodes']} nodes, {plan['n_elements']} elements, {plan['n_unknowns']} unknowns")
    for note in plan["mesh_notes"]:
        screen.print(f"note on the mesh: {note}")
    for support in plan["supports"]:
        screen.print(f"support: {support}", soft_wrap=True)
    screen.print(f"held nodes: {held}")
    for load in plan["loads"]:
        screen.print(f"load: {load}", soft_wrap=True)
    for tool in plan["tools"]:
        screen.print(f"tool: {tool}", soft_wrap=True)
    force = ", ".join(f"{component:g}" for component in plan["total_force"])
    motion = f", prescribed motion up to {plan['largest_motion']:g} m" if plan["largest_motion"] else ""
    steps = "" if plan["motion"] else f", in {plan['load_steps']} load steps"
    screen.print(f"total force ({force}) N{motion}{steps}")
    if plan["motion"]:
        screen.print(f"motion: {plan['motion']}")
    probe = "the node that moves most" if plan["probe"] is None else f"the node at {plan['probe']} m"
    screen.print(f"probe: {probe}")
    for name, model in plan["models"].items():
        screen.print(f"  {name}: {model['label']}", *(f"\n    warning: {text}" for text in model.get("warnings", ())))
    compare = plan["compare"]
    screen.print(f"compared: {compare['model']} with {', '.join(compare['references']) or 'nothing'}\n")


CHECK = Verb(
    "check",
    "check a study and show mesh, supports, loads and moduli; solves nothing",
    _add,
    _run,
    (
        "truespring check strip.toml",
        "truespring check strip.toml mesh.toml --verbose",
    ),
    ("verbose", "json", "quiet", "threads"),
)
