"""report.html: one file, self-contained, that tells and shows what one or several studies found."""

import base64
import platform
import re
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Any
from urllib.parse import quote

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.equilibrium import Path, Status
from truespring.material import PlaneStrain, PlaneStress
from truespring.models import Moduli
from truespring.problem import Problem
from truespring.report.bodies import magnification, path_lines, picture_box
from truespring.report.figures import Drawing, over_name, render_figures
from truespring.report.quantity import given, natural_scale, percent, quantity, significant, times, tolerance_percent
from truespring.report.result import Result
from truespring.report.style import full_name
from truespring.report.verdict import (
    closest_sentence,
    deep,
    display_name,
    drive,
    force_sentence,
    level_name,
    material_name,
    mesh_sentence,
    moduli_sentence,
    nearest_reference,
    reach,
    verdict_sentences,
)

#: Numbers that the viewers of one page may hold together: about a megabyte.
_BUDGET = 400_000

#: A picture of more bytes as SVG than this is shown as PNG.
_LARGEST_SVG = 150_000


def write_page(results: Sequence[Result], file: FilePath, command: str) -> None:
    """Write one page over `results`; `command` is what runs them again."""
    file.write_text(render_page(results, command), encoding="utf-8")


def render_page(results: Sequence[Result], command: str) -> str:
    """Return the page as HTML: it loads nothing from anywhere."""
    from jinja2 import Environment, StrictUndefined

    folder = files("truespring.report")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["close"] = _close
    template = environment.from_string((folder / "page.html.j2").read_text(encoding="utf-8"))
    return template.render(
        title=results[0].title if len(results) == 1 else f"{len(results)} studies",
        studies=[_study(result, place, _BUDGET // len(results)) for place, result in enumerate(results, 1)],
        versions=_versions(),
        command=command,
        script=(folder / "viewer.js").read_text(encoding="utf-8"),
    )


def _close(text: str) -> str:
    """Keep a number and its unit on one line."""
    return re.sub(r"(?<=\d) (?=(?:%|[kMGmµn]?(?:Pa|N|m))(?:\W|$))", "\N{NO-BREAK SPACE}", text)


def _versions() -> list[tuple[str, str]]:
    found = [("python", platform.python_version())]
    for package in ("truespring", "numpy", "scipy", "scikit-fem"):
        try:
            found.append((package, version(package)))
        except PackageNotFoundError:
            found.append((package, "not installed as a package"))
    return sorted(found, key=lambda one: one[0] != "truespring")


def _study(result: Result, place: int, budget: int) -> dict[str, Any]:
    drawings = render_figures(result)
    nearest = result.closest if len(result.comparisons) == 1 else nearest_reference(result)
    return {
        "id": f"study-{place}",
        "title": result.title,
        "verdict": verdict_sentences(result),
        "more": [text for say in (closest_sentence, force_sentence, mesh_sentence) if (text := say(result))],
        "converged": result.converged,
        "closest": display_name(result, nearest) if nearest else None,
        "warnings": [(name, path.label, text) for name, path in result.paths.items() for text in path.warnings],
        "facts": _facts(result),
        "short": _in_short(result),
        "note": result.note,
        "file": str(result.file),
        "pictures": {name: _picture(drawings[name]) for name in drawings},
        "over": [
            {"name": name, "label": one.reference.label, "picture": _picture(drawings[over_name(result, name)])}
            for name, one in result.comparisons.items()
            if over_name(result, name) in drawings
        ],
        "viewer": _viewer(result, budget),
        "model": result.model,
        "full": level_name(result, 1.0),
        "tolerance": tolerance_percent(result.tolerance),
        "measures": _measures(result),
        "comparisons": [_comparison_row(result, name) for name in result.comparisons],
        "models": [_model_row(name, path) for name, path in result.paths.items()],
        "moduli": [_moduli(result, name, path.moduli) for name, path in result.paths.items() if path.moduli],
        "moduli_note": _section_note(result.problem),
        "source": result.source,
    }


def _picture(drawing: Drawing) -> dict[str, str]:
    """A picture as the address that an <img> takes it from, its width on paper in CSS pixels, and its words."""
    if len(drawing.svg) <= _LARGEST_SVG:
        address = "data:image/svg+xml," + quote(drawing.svg.decode().replace('"', "'"), safe=" =:/;,'()!*?")
    else:
        address = "data:image/png;base64," + base64.b64encode(drawing.png).decode()
    return {"address": address, "width": f"{96 * drawing.width:.0f}", "title": drawing.title}


# --- tables ---------------------------------------------------------------------------------------


def _facts(result: Result) -> list[tuple[str, str]]:
    """What was asked, in words."""
    problem = result.problem
    mesh = problem.mesh
    size = " × ".join(given(float(extent), "m") for extent in mesh.upper - mesh.lower)
    facts = [
        ("body", size),
        ("mesh", f"{mesh.n_nodes} nodes, {len(mesh.elements)} elements ({mesh.element})"),
    ]
    if problem.material is not None:
        young = given(problem.material.young, "Pa")
        facts.append(("material", f"Young’s modulus {young}, Poisson’s ratio {problem.material.poisson:.4g}"))
    if problem.section is not None:
        kind = "plane stress" if isinstance(problem.section, PlaneStress) else "plane strain"
        facts.append(("section", f"{kind}, {given(problem.section.thickness, 'm')} thick"))
    facts += _drive_facts(problem)
    at = ", ".join(given(float(value), "m") for value in mesh.nodes[result.probe])
    facts.append(("probe", f"node {result.probe} at ({at}), the red dot"))
    return facts


def _drive_facts(problem: Problem) -> list[tuple[str, str]]:
    facts = []
    total = problem.loading.external_force.sum(axis=0)
    if problem.loading.external_force.any():
        facts.append(("total force", f"({', '.join(given(float(value), 'N') for value in total)})"))
    motion = problem.loading.displacement
    if motion.any():
        moved = int(motion.any(axis=1).sum())
        largest = given(float(np.linalg.norm(motion, axis=1).max()), "m")
        facts.append(("prescribed motion", f"up to {largest}, at {moved} nodes"))
    return facts


def _in_short(result: Result) -> str:
    """The facts that tell one study from another, in a line."""
    words = dict(_facts(result))
    problem = result.problem
    parts = [words["body"]]
    if problem.material is not None:
        parts.append(f"E = {given(problem.material.young, 'Pa')}, ν = {problem.material.poisson:.4g}")
    parts += [words[name] for name in ("section",) if name in words]
    parts += [f"{name} {words[name]}" for name in ("total force", "prescribed motion") if name in words]
    return " · ".join([*parts, f"{len(problem.mesh.elements)} elements"])


def _measures(result: Result) -> list[str]:
    """The errors of the comparison table, in the order of _comparison_row; the force where a motion drives."""
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
        "outline": None
        if one.surface is None
        else f"outlines {quantity(one.surface.outline_rms, 'm', 2)} apart, {quantity(one.surface.outline_max, 'm', 2)} "
        f"at most; nodes {quantity(one.surface.nodes_rms, 'm', 2)} from the nearest of the file",
        "closest": name == nearest_reference(result),
    }


def _share(error: float | None) -> str:
    return "–" if error is None else percent(error)


def _model_row(name: str, path: Path) -> dict[str, Any]:
    """What a path cost and how sound it is; a dash where it was read, not solved."""
    solved = path.potential is not None
    stretches = [state.stretch for state in path.states if state.stretch is not None]
    areas = [state.area_ratio for state in path.states]
    stretch = "–"
    if stretches:
        stretch = f"{min(low for low, _ in stretches):.3f} to {max(high for _, high in stretches):.3f}"
    return {
        "name": name,
        "label": path.label,
        "status": str(path.status),
        "sound": path.status is Status.CONVERGED,
        "advice": path.status.advice if solved else "read from a file, not solved here",
        "load_factor": f"{path.load_factor:.4g}" if path.states else "–",
        "iterations": str(path.newton_iterations) if solved else "–",
        "seconds": f"{path.seconds:.2f}" if solved else "–",
        "unknowns": str(int((~path.problem.loading.held).sum())) if solved else "–",
        "area": f"{min(areas):.3f}" if areas else "–",
        "stretch": stretch,
        "stability": _stability(path) if solved else "–",
    }


def _stability(path: Path) -> str:
    counts = [state.negative_eigenvalues for state in path.states]
    if any(counts):
        first = next(state.load_factor for state in path.states if state.negative_eigenvalues)
        return f"unstable at {first:.4g}"
    if None in counts:
        return "not proven"
    return "stable, after buckling" if any(state.branched for state in path.states) else "stable"


def _moduli(result: Result, name: str, moduli: Moduli) -> dict[str, Any]:
    young, poisson = quantity(moduli.young_wanted, "Pa"), f"{moduli.poisson_wanted:.3f}"
    path = result.paths[name]
    return {
        "name": name,
        "label": path.label,
        "sentence": moduli_sentence(path),
        "wanted": material_name(result),
        "rows": [
            ("Young’s modulus along x", quantity(moduli.young(), "Pa"), young),
            ("Young’s modulus at 45°", quantity(moduli.young(45), "Pa"), young),
            ("Poisson’s ratio along x", f"{moduli.poisson():.3f}", poisson),
            ("Poisson’s ratio at 45°", f"{moduli.poisson(45):.3f}", poisson),
            ("Zener ratio (1 is isotropic)", f"{moduli.zener:.3f}", "1"),
        ],
        "bending": [
            (deep(depth), significant(factor, 4), significant(moduli.fem_bending[depth], 4), depth == moduli.depth)
            for depth, factor in sorted(moduli.bending.items())
        ],
    }


def _section_note(problem: Problem) -> str | None:
    """In plane strain, where the wanted moduli come from."""
    if problem.material is None or not isinstance(problem.section, PlaneStrain):
        return None
    young, poisson = problem.section.plane_moduli(problem.material)
    seen = f"E/(1 − ν²) = {quantity(young, 'Pa')} and ν/(1 − ν) = {poisson:.3f}"
    own = f"E = {given(problem.material.young, 'Pa')} and ν = {problem.material.poisson:.4g}"
    unbroken = re.sub(r" (?=[−=])|(?<=[−=]) ", "\N{NO-BREAK SPACE}", f"{seen}: the material’s own are {own}")
    return f"In plane strain a test within the plane finds {unbroken}."


# --- the viewer -----------------------------------------------------------------------------------


def _viewer(result: Result, budget: int) -> dict[str, Any] | None:
    """What the picture that moves is drawn from; None where nothing moves or it would be too much for a page."""
    order = [result.model] if result.model is not None else []
    names = order + [name for name in result.paths if name not in order]
    shown = [name for name in names if len(result.paths[name].states) > 1 or name != names[0]]
    shown = [name for name in shown if result.paths[name].states or result.paths[name].surface is not None]
    if not shown or shown[0] != names[0]:
        return None
    mesh = result.problem.mesh
    levels = _levels(result.paths[names[0]], budget // (2 * mesh.n_nodes * len(shown)))
    if len(levels) < 2:
        return None
    factor = 1.0 if any(_only_surface(result.paths[name]) for name in shown) else magnification(result)
    first, *others = (_cloud(result.paths[name], factor) for name in shown)
    lower, upper, leaves = picture_box(np.concatenate([mesh.nodes, first]), others)
    extent = (upper - lower)[:2]
    pack = _Packing(lower[:2], float(extent.max()))
    scale = natural_scale(float(extent.max()), "m")
    closest = shown.index(result.closest) - 1 if result.closest in shown else 0
    return {
        "magnified": f"displacements {times(factor)}" if factor != 1 else "",
        "motion": not result.problem.loads,
        "unit": scale.unit,
        "box": [float(value) for value in extent / scale.size],
        "n_nodes": mesh.n_nodes,
        "probe": result.probe,
        "chosen": closest,
        "rest": pack.places(mesh.nodes),
        "outline": pack.pairs(mesh.boundary if mesh.boundary.shape[1] == 2 else mesh.edges),
        "paths": [
            _viewer_path(result, name, levels, pack, factor, beyond)
            for name, beyond in zip(shown, [False, *leaves], strict=True)
        ],
    }


def _only_surface(path: Path) -> bool:
    """Whether a path was read from a file that does not tell where each node went."""
    return path.surface is not None and not path.states


def _cloud(path: Path, factor: float) -> Floats:
    """Every place [m] that the viewer draws of a path, shape (n, dim)."""
    clouds = [path.problem.mesh.nodes + factor * state.displacement for state in path.states]
    return np.concatenate(clouds + ([path.surface.points] if path.surface is not None and factor == 1 else []))


def _levels(path: Path, budget: int) -> list[float]:
    """The load levels to keep so that no more than `budget` states are: every n-th, first and last always."""
    levels = path.load_factors.tolist()
    step = max(1, -(-len(levels) // max(budget - 1, 1)))
    return [levels[0], *levels[:0:-step][::-1]] if budget > 1 else []


def _viewer_path(
    result: Result, name: str, levels: Sequence[float], pack: "_Packing", factor: float, beyond: bool
) -> Mapping[str, Any]:
    """What is drawn and told of a path; `beyond` tells that it leaves the picture, `factor` magnifies."""
    path = result.paths[name]
    to = drive(result)
    rest = path.problem.mesh.nodes
    states = [state for level in levels if (state := path.at(level)) is not None]
    one = result.comparisons.get(name)
    known = dict(zip(one.load_factors.tolist(), one.rms_errors.tolist(), strict=True)) if one else {}
    errors = [next((error for at, error in known.items() if abs(at - s.load_factor) < 1e-9), None) for s in states]
    values: dict[str, Any] = {
        "name": name,
        "label": full_name(result, name),
        "kind": path.kind,
        "beyond": beyond,
        "levels": [state.load_factor for state in states],
        "positions": [pack.places(rest + factor * state.displacement, beyond) for state in states],
        "lines": pack.pairs(path_lines(path)),
        "force": [quantity(to.along(path.applied_force(state)), "N") for state in states],
        "moved": [quantity(float(np.linalg.norm(state.displacement[result.probe])), "m") for state in states],
        "errors": [None if error is None else percent(error) for error in errors],
        "surface": None,
    }
    if path.surface is not None and factor == 1:
        surface = path.surface
        values["surface"] = {
            "level": surface.load_factor,
            "points": pack.places(surface.points, beyond),
            "lines": pack.pairs(surface.outline),
        }
    return values


class _Packing:
    """Numbers as base64: places in 65536 steps of the box, far below a pixel, and pairs of node numbers.

    Places beyond the box are written as single precision numbers of the same steps.
    """

    def __init__(self, lower: Floats, extent: float) -> None:
        self.lower, self.extent = lower, extent or 1.0

    def places(self, points: Floats, beyond: bool = False) -> str:
        steps = 65535 * (points[:, :2] - self.lower) / self.extent
        packed = steps.astype("<f4") if beyond else np.rint(steps).astype("<u2")
        return base64.b64encode(packed.tobytes()).decode()

    def pairs(self, lines: Ints) -> str:
        return base64.b64encode(lines.astype("<u4").tobytes()).decode()
