"""The data of a study in words, for its page: body, mesh, material, loads, tools, motion, probe."""

import numpy as np

from truespring.material import Material
from truespring.mesh import Box, Mesh, select_elements
from truespring.problem import Problem, Region
from truespring.report.axis import history_words
from truespring.report.quantity import input_quantity
from truespring.report.result import Result

# Components of the total force below this share of the sum of all forces are rounding errors.
_ROUNDING = 1e-12


def facts(result: Result) -> list[tuple[str, str]]:
    """Return name and text of the data of a study: those of its problem, finite elements, probe."""
    at = ", ".join(input_quantity(float(f"{value:.4g}"), "m") for value in result.problem.mesh.nodes[result.probe])
    probe = ("probe", f"node {result.probe} at ({at}), the red dot")
    return [*problem_facts(result.problem), *_element_facts(result), probe]


def problem_facts(problem: Problem) -> list[tuple[str, str]]:
    """Return name and text of the data of a problem: body, mesh, material, section, supports, loads, motion."""
    mesh = problem.mesh
    found = [
        ("body", size_words(mesh)),
        ("mesh", f"{mesh.n_nodes} nodes, {len(mesh.elements)} elements ({mesh.kinds})"),
    ]
    if problem.material is not None:
        found.append(("material", _material_words(problem.material)))
    found += [_region_fact(problem, region) for region in problem.regions]
    if problem.section is not None and problem.section.key:
        found.append(("section", f"{problem.section.words}, {input_quantity(problem.section.thickness, 'm')} thick"))
    found += _drive_facts(problem)
    return found + ([("motion", problem.dynamics.words())] if problem.dynamics is not None else [])


def size_words(mesh: Mesh) -> str:
    """Return the size of a mesh along the axes, with units."""
    return " × ".join(input_quantity(float(f"{extent:.4g}"), "m") for extent in mesh.upper - mesh.lower)


def _element_facts(result: Result) -> list[tuple[str, str]]:
    """Return the kinds of finite elements that are not linear ones."""
    used = {path.element for path in result.solutions.values()}
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
    found = [("support", words) for words in supports]
    found += [("load", load.words() + history_words(problem, load.over)) for load in problem.loads]
    found += [("tool", tool.words()) for tool in problem.touching]
    loading = problem.loading.full
    forces = loading.force(problem.mesh.nodes)
    total = forces.sum(axis=0)
    total = np.where(np.abs(total) > _ROUNDING * np.abs(forces).sum(), total, 0.0)
    if not loading.driven_by_motion:
        found.append(("total force", f"({', '.join(input_quantity(float(value), 'N') for value in total)})"))
    motion = loading.motion()
    if motion.any():
        moved = int(motion.any(axis=1).sum())
        largest = input_quantity(float(np.linalg.norm(motion, axis=1).max()), "m")
        found.append(("prescribed motion", f"up to {largest}, at {moved} nodes"))
    return found


def in_short(result: Result) -> str:
    """Return the main data of a study in one line."""
    words = dict(facts(result))
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
