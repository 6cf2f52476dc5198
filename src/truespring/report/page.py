"""report.html: one self-contained file with the results of one or several studies."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from truespring.comparison import Comparison
from truespring.equilibrium import FINE, Solution, Status
from truespring.material import Material
from truespring.mesh import Box, select_elements
from truespring.models import Moduli
from truespring.potential import Noted
from truespring.problem import Problem, Region
from truespring.report.axis import Axis, axis_of, history_words
from truespring.report.figures import distance_name, energies_name, film_name, over_name, render_figures
from truespring.report.parts import part_rows
from truespring.report.quantity import input_quantity, percent, quantity, significant, tolerance_percent
from truespring.report.result import Result
from truespring.report.shell import picture, render
from truespring.report.standing import own_errors
from truespring.report.supports import support_rows
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
# Components of the total force below this share of the sum of all forces are rounding errors.
_ROUNDING = 1e-12


def write_page(results: Sequence[Result], file: Path, command: str | None) -> None:
    """Write one page on `results`; `command` is the command line that repeats the run."""
    file.write_text(render_page(results, command), encoding="utf-8")


def render_page(results: Sequence[Result], command: str | None) -> str:
    """Return the page as HTML."""
    studies = [_study(result, place, _BUDGET // len(results)) for place, result in enumerate(results, 1)]
    what, several = ("comparison", "comparisons") if results[0].in_detail else ("study", "studies")
    has_3d_view = any(study["viewer"] and study["in_space"] for study in studies)
    scene = ("report/scene.min.js",) if has_3d_view else ()
    return render(
        "report/page.html.j2",
        command,
        (*scene, "report/viewer.js"),
        title=results[0].title if len(results) == 1 else f"{len(results)} {several}",
        what=what,
        studies=studies,
    )


def _study(result: Result, place: int, budget: int) -> dict[str, Any]:
    drawings = render_figures(result)
    pictures = {name: picture(drawing) for name, drawing in drawings.items()}
    nearest = result.closest if len(result.comparisons) == 1 else nearest_reference(result)
    in_space = result.problem.mesh.dim == 3
    moving = viewer(result, budget)
    return {
        "id": f"study-{place}",
        "title": result.title,
        "verdict": verdict_sentences(result),
        "more": [text for sentence in _SENTENCES if (text := sentence(result))],
        "converged": result.converged,
        "closest": display_name(result, nearest) if nearest else None,
        "warnings": [(name, path.label, text) for name, path in result.paths.items() for text in path.warnings],
        "mesh_notes": result.problem.mesh.notes,
        "drawing_notes": sorted({drawing.note for drawing in drawings.values()} - {""}),
        "in_space": in_space,
        "coloured": any(distance_name(result, name) in pictures for name in result.comparisons),
        "stated": result.problem.stated,
        "solved": any(path.potential is not None for path in result.paths.values()),
        "too_large": in_space and moving is None and any(len(path.states) > 1 for path in result.paths.values()),
        "facts": _facts(result),
        "short": _in_short(result),
        "note": result.note,
        "file": str(result.file),
        "pictures": pictures,
        "over": [
            pictures[drawn]
            for name in result.comparisons
            for drawn in (over_name(result, name), distance_name(result, name))
            if drawn in pictures
        ],
        "films": [pictures[drawn] for drawn in _films(result) if drawn in pictures],
        "parts": part_rows(result),
        "histories": ["curves", "reactions", "tools", *map(energies_name, result.paths), "error"],
        "viewer": moving,
        "model": result.model,
        "axis": axis_of(result),
        "tolerance": tolerance_percent(result.tolerance),
        "measures": _measures(result),
        "supports": list(support_rows(result)),
        "comparisons": [_comparison_row(result, name) for name in result.comparisons],
        "models": [_model_row(name, path, axis_of(result)) for name, path in result.paths.items()],
        "moduli": [_moduli(result, name, path.moduli) for name, path in result.paths.items() if path.moduli],
        "own_errors": {name: own_errors(result, name) for name in result.comparisons} if result.standings else {},
        "moduli_note": _section_note(result.problem),
        "source": result.source,
    }


def _films(result: Result) -> Iterator[str]:
    """Yield the names that film strips may have, the nearest reference first."""
    names = sorted(result.paths, key=lambda name: name != result.closest)
    yield from (film_name(result, name) for name in [*names, ""])


_SENTENCES = (carrying_sentence, closest_sentence, cause_sentence, force_sentence, mesh_sentence)


# --- tables ---------------------------------------------------------------------------------------


def _facts(result: Result) -> list[tuple[str, str]]:
    """Return name and text of the data of a study: body, mesh, material, loads, probe."""
    problem = result.problem
    mesh = problem.mesh
    size = " × ".join(input_quantity(float(f"{extent:.4g}"), "m") for extent in mesh.upper - mesh.lower)
    facts = [
        ("body", size),
        ("mesh", f"{mesh.n_nodes} nodes, {len(mesh.elements)} elements ({mesh.kinds})"),
    ]
    if problem.material is not None:
        facts.append(("material", _material_words(problem.material)))
    facts += [_region_fact(problem, region) for region in problem.regions]
    if problem.section is not None and problem.section.key:
        facts.append(("section", f"{problem.section.words}, {input_quantity(problem.section.thickness, 'm')} thick"))
    facts += _drive_facts(problem)
    facts += [("motion", problem.dynamics.words())] if problem.dynamics is not None else []
    facts += _element_facts(result)
    at = ", ".join(input_quantity(float(f"{value:.4g}"), "m") for value in mesh.nodes[result.probe])
    facts.append(("probe", f"node {result.probe} at ({at}), the red dot"))
    return facts


def _element_facts(result: Result) -> list[tuple[str, str]]:
    """Return the kinds of finite elements that are not linear ones."""
    used = {path.element for path in result.paths.values()}
    kinds = {
        "mean-dilatation": "mean dilatation, which does not lock in nearly incompressible material",
        "quadratic": "second order, with mid-side nodes",
        "quadratic-mean-dilatation": "second order with mean dilatation, which does not lock in nearly incompressible "
        "material",
    }
    return [("finite elements", words) for name, words in kinds.items() if name in used]


def _material_words(material: Material) -> str:
    words = f"Young’s modulus {input_quantity(material.young, 'Pa')}, Poisson’s ratio {material.poisson:.4g}"
    return words if material.fibres is None else f"{words}, {material.fibres.words()}"


def _region_fact(problem: Problem, region: Region) -> tuple[str, str]:
    """Return a part of another material: the name of its group, or the corners of its box."""
    named = region.on if isinstance(region.on, str) else "elements by number"
    if isinstance(region.on, Box):
        corners = (
            ", ".join(input_quantity(value, "m") for value in corner) for corner in (region.on.lower, region.on.upper)
        )
        named = " to ".join(f"({corner})" for corner in corners)
    count = len(select_elements(problem.mesh, region.on))
    return "region", f"{named}, {count} element{'s' * (count != 1)}: {_material_words(region.material)}"


def _drive_facts(problem: Problem) -> list[tuple[str, str]]:
    """Return each support and load, the total force, and the largest prescribed motion."""
    if not problem.stated:
        return [("loads and supports", "not in the file")]
    supports = [support.words(problem.mesh.dim) + history_words(problem, support.over) for support in problem.supports]
    facts = [("support", words) for words in supports]
    facts += [("load", load.words() + history_words(problem, load.over)) for load in problem.loads]
    facts += [("tool", tool.words()) for tool in problem.touching]
    loading = problem.loading.full
    forces = loading.force(problem.mesh.nodes)
    total = forces.sum(axis=0)
    total = np.where(np.abs(total) > _ROUNDING * np.abs(forces).sum(), total, 0.0)
    if not loading.driven_by_motion:
        facts.append(("total force", f"({', '.join(input_quantity(float(value), 'N') for value in total)})"))
    motion = loading.motion()
    if motion.any():
        moved = int(motion.any(axis=1).sum())
        largest = input_quantity(float(np.linalg.norm(motion, axis=1).max()), "m")
        facts.append(("prescribed motion", f"up to {largest}, at {moved} nodes"))
    return facts


def _in_short(result: Result) -> str:
    """Return the main data of a study in one line."""
    words = dict(_facts(result))
    problem = result.problem
    parts = [words["body"]]
    if problem.material is not None:
        parts.append(f"E = {input_quantity(problem.material.young, 'Pa')}, ν = {problem.material.poisson:.4g}")
    parts += [words[name] for name in ("section",) if name in words]
    n_regions = len(problem.regions)
    parts += [f"{n_regions} region{'s' * (n_regions != 1)} of another material"] if n_regions else []
    parts += [f"{name} {words[name]}" for name in ("total force", "prescribed motion") if name in words]
    parts += ["loads and supports not in the file"] if not problem.stated else []
    return " · ".join([*parts, f"{len(problem.mesh.elements)} elements"])


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
    path = result.paths[name]
    return {
        "name": name,
        "label": path.label,
        "sentence": moduli_sentence(path),
        "fit": result.fitness[name].fit if name in result.fitness else None,
        "judged": result.fitness[name].sentence if name in result.fitness else "",
        "material": material_name(result) + (", outside its regions" if result.problem.regions else ""),
        "rows": _moduli_rows(moduli),
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


def _moduli_rows(moduli: Moduli) -> list[tuple[str, str, str]]:
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
