"""Summarise a study without solving it, for `check`."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from truespring.material import Material
from truespring.mesh.selections import AXES
from truespring.models import (
    judge,
    springs_by_rule,
)
from truespring.potential import Stretched
from truespring.problem import Problem
from truespring.report.summary import moduli_values
from truespring.study.moduli import finding_values
from truespring.study.read import Study


def _values(material: Material) -> dict[str, Any]:
    """Return the keys of `[material]` with their values in SI units."""
    young, poisson, density = material.young, material.poisson, material.density
    values = {"young": young, "poisson": poisson, "density": density, **dict(material.constants)}
    fibres = material.fibres
    return values if fibres is None else {**values, "fibres": asdict(fibres)}


def plan(study: Study) -> dict[str, Any]:
    """Return size, mesh, loads, supports, models and effective moduli of a study as JSON values; solve nothing."""
    problem = study.problem
    mesh, loading = problem.mesh, problem.loading
    return {
        "title": study.title,
        "size": (mesh.upper - mesh.lower).tolist(),
        "n_nodes": mesh.n_nodes,
        "n_elements": len(mesh.elements),
        "mesh_notes": list(mesh.notes),
        "material": _values(problem.material) if problem.material else None,
        "regions": [
            {**_values(material), "n_elements": int((problem.material_numbers == number).sum())}
            for number, material in enumerate(problem.materials[1:], start=1)
        ],
        "section": _section(problem),
        "n_unknowns": int((~loading.held).sum()),
        "supports": [support.words(mesh.dim) for support in problem.supports],
        "loads": [load.words() for load in problem.loads],
        "tools": [one.words() for one in problem.touching],
        "held": {axis: int(loading.held[:, number].sum()) for number, axis in enumerate(AXES[: mesh.dim])},
        "total_force": loading.full.loads(mesh.nodes).sum(axis=0).tolist(),
        "largest_motion": float(np.linalg.norm(loading.full.motion(), axis=1).max()),
        "motion": None if problem.dynamics is None else problem.dynamics.words(),
        "load_steps": study.solver.load_steps,
        "models": {name: _model_plan(study, name) for name in study.entries},
        "compare": {"model": study.model, "references": list(study.references), "tolerance": study.tolerance},
        "probe": None if study.probe is None else mesh.nodes[study.probe].tolist(),
    }


def _section(problem: Problem) -> dict[str, Any] | None:
    if problem.section is None or not problem.section.key:
        return None
    return {"kind": problem.section.key, "thickness": problem.section.thickness}


def _model_plan(study: Study, name: str) -> Mapping[str, Any]:
    """Return label, law, element, number of springs, moduli and warnings of a model."""
    problem, model = study.problem, study.entries[name]
    realised = model.moduli(problem.homogeneous[0]) if problem.material is not None else None
    plan: dict[str, Any] = {"kind": study.keys.models[name].kind, "label": model.label_on(problem)}
    plan |= {} if model.law is None else {"law": model.law}
    element = model.chosen_element(problem)
    plan |= {} if element is None else {"element": element}
    if realised is not None:
        plan |= {"n_springs": realised.n_springs, "moduli": moduli_values(realised)}
    elif model.has_springs:
        potential = model.potential(problem)
        plan |= {"n_springs": len(potential.springs)} if isinstance(potential, Stretched) else {}
    for springs in springs_by_rule({name: model}).values():
        fitness = judge(problem, springs, study.tolerance)
        plan |= {"fit": fitness.fit, "sentence": fitness.sentence, "findings": finding_values(fitness.findings)}
    return plan | {"warnings": list(model.warnings(problem))}
