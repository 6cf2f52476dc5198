"""report.html: one self-contained file with the results of one or several studies."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from truespring.comparison import Comparison
from truespring.equilibrium import FINE, Solution, Status
from truespring.models import Moduli
from truespring.potential import Noted
from truespring.problem import Problem
from truespring.report.axis import Axis, axis_of
from truespring.report.downloads import Films, downloads, moving_picture
from truespring.report.facts import facts, in_short
from truespring.report.figures import distance_name, energies_name, film_name, over_name, render_figures
from truespring.report.parts import part_rows
from truespring.report.quantity import input_quantity, percent, quantity, significant, tolerance_percent
from truespring.report.result import Result
from truespring.report.shell import picture, render
from truespring.report.standing import own_errors
from truespring.report.supports import support_rows, support_title
from truespring.report.verdict import (
    carrying_sentence,
    cause_sentence,
    closest_sentence,
    deep,
    display_name,
    force_sentence,
    linear_fem,
    material_name,
    mesh_sentence,
    moduli_sentence,
    nearest_reference,
    reach,
    verdict_sentences,
)
from truespring.report.viewer import viewer

# Largest number of values in all interactive views of a page, about a megabyte.
_BUDGET = 400_000
# What draws bodies in 3D and plane ones.
_DRAWING = {True: "report/scene.min.js", False: "report/plane.js"}


def write_page(results: Sequence[Result], file: Path, command: str | None, films: Sequence[Films] = ()) -> None:
    """Write one page on `results`; see `render_page`."""
    file.write_text(render_page(results, command, films), encoding="utf-8")


def render_page(results: Sequence[Result], command: str | None, films: Sequence[Films] = ()) -> str:
    """Return the page as HTML.

    Args:
        results: of one or several studies.
        command: the command line that repeats the run.
        films: the animation of each study; empty without animations.
    """
    budget, level = _BUDGET // len(results), "h3" if len(results) > 1 else "h2"
    studies = [
        {**_study(result, place, budget), "level": level, **_taken(result, shown)}
        for place, (result, shown) in enumerate(zip(results, films or [{}] * len(results), strict=True), 1)
    ]
    what, several = ("comparison", "comparisons") if results[0].in_detail else ("study", "studies")
    drawn = {study["in_space"] for study in studies if study["viewer"]}
    scripts = [file for in_space, file in _DRAWING.items() if in_space in drawn]
    return render(
        "report/page.html.j2",
        command,
        (*scripts, "report/viewer.js"),
        title=results[0].title if len(results) == 1 else f"{len(results)} {several}",
        what=what,
        several=several,
        studies=studies,
    )


def _study(result: Result, place: int, budget: int) -> dict[str, Any]:
    drawings = render_figures(result)
    pictures = {name: picture(drawing, f"{result.stem}_{name}") for name, drawing in drawings.items()}
    nearest = result.closest if len(result.comparisons) == 1 else nearest_reference(result)
    in_space = result.problem.mesh.dim == 3
    moving = viewer(result, budget)
    return {
        "id": f"study-{place}",
        "title": result.title,
        "stem": result.stem,
        "verdict": verdict_sentences(result),
        "more": [text for sentence in _SENTENCES if (text := sentence(result))],
        "converged": result.converged,
        "closest": display_name(result, nearest) if nearest else None,
        "warnings": [(name, path.label, text) for name, path in result.solutions.items() for text in path.warnings],
        "mesh_notes": result.problem.mesh.notes,
        "drawing_notes": sorted({drawing.note for drawing in drawings.values()} - {""}),
        "in_space": in_space,
        "coloured": any(distance_name(result, name) in pictures for name in result.comparisons),
        "stated": result.problem.stated,
        "solved": any(path.potential is not None for path in result.solutions.values()),
        "too_large": in_space and moving is None and any(len(path.states) > 1 for path in result.solutions.values()),
        "facts": facts(result),
        "short": in_short(result),
        "note": result.note,
        "file": str(result.file),
        "pictures": pictures,
        "over": [pictures[drawn] for name in result.comparisons for drawn in _over(result, name, pictures)],
        "films": [pictures[drawn] for drawn in _films(result) if drawn in pictures],
        "parts": part_rows(result),
        "histories": [
            "curves",
            *_reactions(pictures),
            "tools",
            *map(energies_name, result.solutions),
            "error",
        ],
        "viewer": moving,
        "model": result.model,
        "axis": axis_of(result),
        "tolerance": tolerance_percent(result.tolerance),
        "measures": _measures(result),
        "supports": list(support_rows(result)),
        "support_title": support_title(result),
        "over_the_way": any(one.over_the_way for one in result.comparisons.values()),
        "comparisons": [_comparison_row(result, name) for name in result.comparisons],
        "models": [_model_row(name, path, axis_of(result)) for name, path in result.solutions.items()],
        "moduli": [_moduli(result, name, path.moduli) for name, path in result.solutions.items() if path.moduli],
        "own_errors": {name: own_errors(result, name) for name in result.comparisons} if result.standings else {},
        "moduli_note": _section_note(result.problem),
        "source": result.source,
    }


def _taken(result: Result, films: Films) -> dict[str, Any]:
    return {"downloads": downloads(result, films), "moving_picture": moving_picture(result, films)}


def _over(result: Result, name: str, pictures: Mapping[str, Any]) -> list[str]:
    """Return the name of the picture of the model over a reference; the one coloured by distance if there is one."""
    both = (distance_name(result, name), over_name(result, name))
    return [drawn for drawn in both if drawn in pictures][:1]


def _reactions(pictures: Mapping[str, Any]) -> list[str]:
    """Return the names of the curves of moved supports."""
    return [name for name in pictures if name.startswith("reactions")]


def _films(result: Result) -> Iterator[str]:
    """Yield the names that film strips may have, the nearest reference first."""
    names = sorted(result.solutions, key=lambda name: name != result.closest)
    yield from (film_name(result, name) for name in [*names, ""])


_SENTENCES = (carrying_sentence, closest_sentence, cause_sentence, force_sentence, mesh_sentence)


# --- tables ---------------------------------------------------------------------------------------


def _measures(result: Result) -> list[str]:
    """Return the names of the errors in the order of `_comparison_row`, with the force if supports move."""
    forced = any(one.force_error is not None for one in result.comparisons.values())
    return ["root mean square", "at the probe", "largest", *(["force"] if forced else [])]


def _comparison_row(result: Result, name: str) -> dict[str, Any]:
    one = result.comparisons[name]
    errors = [one.rms_error, one.probe_error, one.max_error, one.force_error]
    return {
        "name": name,
        "label": one.reference.label,
        "errors": [_share(error) for error, _ in zip(errors, _measures(result), strict=False)],
        "reach": reach(result, one) if one.load_factors.size else "–",
        "apart": "; ".join(_apart(one, result.in_detail)),
        "closest": name == nearest_reference(result),
    }


def _apart(one: Comparison, in_detail: bool) -> Iterator[str]:
    """Yield distances [m] and the error of the stored energy of a comparison."""
    if in_detail and one.load_factors.size and one.compared.any():
        rms, most = (float(several[-1]) for several in (one.rms_distances, one.max_distances))
        yield f"distance of nodes {quantity(rms, 'm', 2)} (root mean square), {quantity(most, 'm', 2)} at most"
    if one.surface is not None:
        outlines = quantity(one.surface.outline_rms, "m", 2), quantity(one.surface.outline_max, "m", 2)
        yield "distance of outlines {}, {} at most".format(*outlines)
        yield f"distance of nodes to the nearest of the file {quantity(one.surface.nodes_rms, 'm', 2)}"
    elif in_detail and one.hausdorff is not None:
        surfaces = quantity(one.hausdorff.rms, "m", 2), quantity(one.hausdorff.max, "m", 2)
        yield "distance of surfaces {}, {} at most (Hausdorff)".format(*surfaces)
    if in_detail and one.energy_error is not None:
        yield f"stored energy {percent(one.energy_error)} off"


def _share(error: float | None) -> str:
    return "–" if error is None else percent(error)


def _model_row(name: str, path: Solution, axis: Axis) -> dict[str, Any]:
    """Return cost, status and stability of a path; a dash for what a path from a file does not have."""
    solved = path.solved
    stretches = [state.stretch for state in path.states if state.stretch is not None]
    areas = [] if path.is_cloud else [state.area_ratio for state in path.states]
    stretch = "–"
    if stretches:
        stretch = f"{min(low for low, _ in stretches):.3f} to {max(high for _, high in stretches):.3f}"
    return {
        "name": name,
        "label": path.label,
        "status": str(path.status),
        "sound": path.status in FINE,
        "advised": path.status is not Status.CONVERGED,
        "advice": path.status.advice if solved else "read from a file, not solved here",
        "load_factor": axis.number(path.load_factor) if path.states else "–",
        "iterations": str(path.newton_iterations) if solved else "–",
        "effort": _effort(path),
        "fields": path.potential.cell_note if isinstance(path.potential, Noted) else None,
        "seconds": f"{path.seconds:.2f}" if solved else "–",
        "unknowns": str(path.n_unknowns) if solved else "–",
        "area": f"{min(areas):.3f}" if areas else "–",
        "stretch": stretch,
        "stability": _stability(path) if solved and not axis.moves else "–",
    }


def _effort(path: Solution) -> str | None:
    """Return solvers and iterations of a path, and notes on solvers that were replaced."""
    cost = path.cost
    if cost is None:
        return None
    parts = [cost.newton, cost.linear, _counted(cost.newton_iterations, "Newton iteration")]
    parts += [_counted(cost.cg_iterations, "CG iteration")] if cost.cg_iterations else []
    parts += [f"{cost.lanczos_iterations} of Lanczos for stability"] if cost.lanczos_iterations else []
    coarse = ", ".join(str(one.newton_iterations) for one in cost.coarse)
    started = [f"on coarser meshes before that {coarse} Newton iterations"] if coarse else []
    return "; ".join([", ".join(parts), *started, *cost.notes])


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}{'s' * (count != 1)}"


def _stability(path: Solution) -> str:
    counts = [state.negative_eigenvalues for state in path.states]
    if any(counts):
        first = next(state.load_factor for state in path.states if state.negative_eigenvalues)
        return f"unstable at {first:.4g}"
    if None in counts:
        return "not checked"
    return "stable, after buckling" if any(state.branched for state in path.states) else "stable"


def _moduli(result: Result, name: str, moduli: Moduli) -> dict[str, Any]:
    path = result.solutions[name]
    return {
        "name": name,
        "label": path.label,
        "sentence": moduli_sentence(path),
        "fit": result.fitness[name].fit if name in result.fitness else None,
        "judged": result.fitness[name].sentence if name in result.fitness else "",
        "material": material_name(result) + (", outside its regions" if result.problem.regions else ""),
        "rows": moduli_rows(moduli),
        "elements": linear_fem(path).removeprefix("linear "),
        "bending": [
            (
                deep(depth) if moduli.dim == 2 or depth == moduli.depth else f"{depth} by {depth} elements",
                significant(factor, 4),
                significant(moduli.fem_bending[depth], 4),
                depth == moduli.depth,
            )
            for depth, factor in sorted(moduli.bending.items())
        ],
    }


def moduli_rows(moduli: Moduli) -> list[tuple[str, str, str]]:
    """Return name, effective value of the springs and value of the material of each modulus."""
    plane = moduli.dim == 2
    youngs = [("along x", moduli.young()), *([("at 45°", moduli.young(45))] if plane else [])]
    poissons = [("along x", moduli.poisson()), *([("at 45°", moduli.poisson(45))] if plane else [])]
    if not plane or not np.allclose(sorted(value for _, value in youngs), moduli.young_range, rtol=1e-3):
        extremes = ("smallest of all directions", "largest of all directions")
        youngs += zip(extremes, moduli.young_range, strict=True)
        poissons += zip(extremes, moduli.poisson_range, strict=True)
    young, poisson = quantity(moduli.material_young, "Pa"), f"{moduli.material_poisson:.3f}"
    ratio = "Zener ratio (1 is isotropic)" if plane else "largest over smallest Young’s modulus"
    return [
        *((f"Young’s modulus {where}", quantity(value, "Pa"), young) for where, value in youngs),
        *((f"Poisson’s ratio {where}", f"{value:.3f}", poisson) for where, value in poissons),
        (ratio, f"{moduli.anisotropy:.3f}", "1"),
    ]


def _section_note(problem: Problem) -> str | None:
    """Return for plane strain how the moduli within the plane follow from those of the material; else None."""
    if problem.material is None or problem.section is None or not problem.section.moduli_words:
        return None
    young, poisson = problem.section.apparent_moduli(problem.material)
    seen = f"E/(1 − ν²) = {quantity(young, 'Pa')} and ν/(1 − ν) = {poisson:.3f}"
    own = f"E = {input_quantity(problem.material.young, 'Pa')} and ν = {problem.material.poisson:.4g}"
    unbroken = re.sub(r" (?=[−=])|(?<=[−=]) ", "\N{NO-BREAK SPACE}", f"{seen}; those of the material are {own}")
    return f"In plane strain the moduli within the plane are {unbroken}."
