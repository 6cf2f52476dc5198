"""summary.json: status, cost, warnings and errors of one study as JSON values."""

import math
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

import numpy as np

from truespring.comparison import Comparison
from truespring.equilibrium import Solution
from truespring.models import Moduli
from truespring.reactions import moved_supports
from truespring.report.parts import largest_of, parts_of
from truespring.report.result import Result
from truespring.support_errors import SupportError, decisive


def summary(result: Result) -> dict[str, Any]:
    """Return the summary of a study as JSON values; unknown values are None."""
    return {
        "title": result.title,
        "truespring": version("truespring"),
        "model": result.model,
        "models": {name: _model(path, result.probe) for name, path in result.solutions.items()},
        "probe": {"node": result.probe, "position": result.problem.mesh.nodes[result.probe].tolist()},
        "comparison": {name: _comparison(one) | _standing(result, name) for name, one in result.comparisons.items()},
        "closest": result.closest,
    } | _motion(result)


def _motion(result: Result) -> dict[str, Any]:
    """Return duration [s], and errors of the model, of the time step and of the solver of a motion; empty at rest."""
    duration, splits = result.problem.duration, result.splits
    if duration is None:
        return {}
    if splits is None:
        return {"duration": duration}
    parts = parts_of(result)
    most = largest_of(parts)
    model = next((one.value for one in parts if one.name == "model"), None)
    errors = {"model_error": model, "step_error": splits.step, "solver_error": splits.solver}
    return {
        "duration": duration,
        "motion": errors | {"largest": most.name if most else None, "notes": list(splits.notes)},
    }


def _model(path: Solution, probe: int) -> dict[str, Any]:
    last = path.states[-1] if path.states else None
    values = {
        "kind": path.kind,
        "label": path.label,
        "has_springs": path.has_springs,
        "lines": path.lines,
        "status": str(path.status),
        "load_factor": path.load_factor,
        "newton_iterations": path.newton_iterations,
        "seconds": path.seconds,
        "n_nodes": path.problem.mesh.n_nodes,
        "n_unknowns": path.n_unknowns,
        "probe_displacement": last.displacement[probe].tolist() if last else None,
        "energies": [[s.load_factor, s.energy] for s in path.states if math.isfinite(s.energy + s.load_factor)],
        "force": [_known(force) for force in path.applied_force(last).tolist()] if last else None,
        # If a level was not reached, the residual of the best state there.
        "residual": _known((path.best or last).residual) if last else None,
        "negative_eigenvalues": last.negative_eigenvalues if last else None,
        "smallest_area_ratio": min((state.area_ratio for state in path.states), default=None),
        "warnings": list(path.warnings),
        "solver": None if path.cost is None else asdict(path.cost),
    }
    if path.problem.stated and path.problem.returns:
        moved = [float(np.linalg.norm(state.displacement[probe])) for state in path.states]
        values["largest_probe_displacement"] = max(moved, default=None)
    if path.element is not None:
        values["element"] = path.element
    if path.moduli is not None:
        values["moduli"] = moduli_values(path.moduli)
    return values


def moduli_values(moduli: Moduli) -> dict[str, Any]:
    """Return the effective moduli of springs and those of the material; Young's moduli in Pa, bending by depth."""
    plane = moduli.dim == 2
    return {
        "young": moduli.young(),
        "poisson": moduli.poisson(),
        "anisotropy": moduli.anisotropy,
        **({"young_45": moduli.young(45), "poisson_45": moduli.poisson(45)} if plane else {}),
        "young_min": moduli.young_range[0],
        "young_max": moduli.young_range[1],
        "poisson_min": moduli.poisson_range[0],
        "poisson_max": moduli.poisson_range[1],
        "young_wanted": moduli.material_young,
        "poisson_wanted": moduli.material_poisson,
        "directions": [
            {"along": list(along), "young": moduli.young(along), "poisson": moduli.poisson(along)}
            for along in (_PLANE if plane else _SPACE)
        ],
        "depth": moduli.depth,
        "bending_factor": {str(depth): factor for depth, factor in moduli.bending.items()},
        "fem_bending_factor": {str(depth): factor for depth, factor in moduli.fem_bending.items()},
        "lattice": moduli.lattice,
        "patch_score": moduli.patch_score,
        "n_springs": moduli.n_springs,
        "n_negative": moduli.n_negative,
        "n_zero": moduli.n_zero,
        "stable": moduli.stable,
    }


# Directions of the moduli listed.
_PLANE = ((1, 0), (0, 1), (1, 1), (1, -1))
_SPACE = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, 1, 1))


def _comparison(comparison: Comparison) -> dict[str, Any]:
    values: dict[str, Any] = {
        "probe_error": comparison.probe_error,
        "rms_error": comparison.rms_error,
        "max_error": comparison.max_error,
        "agrees_up_to_load_factor": comparison.agrees_up_to_load_factor,
    }
    if moved_supports(comparison.model.problem) or any(comparison.support_errors):
        values |= _of_forces(comparison, comparison.error is not None)
    if (surface := comparison.surface) is not None:
        values["outline_distance"] = {"rms": surface.outline_rms, "max": surface.outline_max}
        values["nearest_node_distance"] = {"rms": surface.nodes_rms, "max": surface.nodes_max}
    return values


def _standing(result: Result, name: str) -> dict[str, float | None]:
    """Return the error of a reference, and that of the model against the refined reference; None if unknown."""
    known = result.standings.get(name)
    return {
        "reference_error": known.value if known else None,
        "refined_error": known.refined_error if known else None,
    }


def _of_forces(comparison: Comparison, known: bool) -> dict[str, Any]:
    """Return the errors of forces at the last level or over the way, if known, and the quantity with the largest."""
    if not known:
        return {"force_error": None, "decided_by": None, "supports": []}
    return {
        "force_error": _known(decisive(math.nan, comparison.last_supports).error),
        "decided_by": comparison.last_decisive.quantity or None,
        "supports": [_support(one) for one in comparison.last_supports],
    }


def _support(one: SupportError) -> dict[str, Any]:
    return {
        "support": None if one.mine.support < 0 else one.mine.support + 1,
        "on": one.mine.name,
        "force": {"model": one.mine.force.tolist(), "reference": one.theirs.force.tolist()},
        "torque": {"model": one.mine.torque.tolist(), "reference": one.theirs.torque.tolist()},
        "force_error": one.force_error,
        "torque_error": one.torque_error,
        "share_of_load": one.share_of_load,
    }


def difference(result: Result) -> dict[str, Any]:
    """Return the difference of two results at the last load level that both have, or over the way, as JSON values.

    Relative errors are those of the summary of a study; distances are in metres; unknown values are None.
    """
    (one,) = result.comparisons.values()
    model, reference = result.solutions  # in this order, whichever is drawn over the other
    surfaces = one.hausdorff

    return {
        "model": model,
        "reference": reference,
        "load_factor": float(one.load_factors[-1]) if one.load_factors.size else None,
        "rms_error": _known(one.last(one.rms_errors)),
        "max_error": _known(one.last(one.max_errors, worst=True)),
        "probe_error": _known(one.last(one.probe_errors)),
        **(_of_forces(one, True) if any(one.support_errors) else {}),
        "energy_error": one.energy_error,
        "rms_distance": _known(one.last(one.rms_distances)),
        "max_distance": _known(one.last(one.max_distances, worst=True)),
        "hausdorff": None if surfaces is None else surfaces.max,
        "surface_rms": None if surfaces is None else surfaces.rms,
        "n_nodes": len(one.outside),
        "n_outside": one.n_outside,
        "n_reference_outside": one.n_reference_outside,
        "node_by_node": one.node_by_node,
        "probe": result.problem.mesh.nodes[result.probe].tolist(),
        "agrees_up_to_load_factor": one.agrees_up_to_load_factor,
        "tolerance": one.tolerance,
        "levels": [
            {
                "load_factor": level,
                "rms_error": _known(error),
                "rms_distance": _known(distance),
                **({"force_error": _known(forced)} if any(one.support_errors) else {}),
            }
            for level, error, distance, forced in zip(
                one.load_factors.tolist(),
                one.rms_errors.tolist(),
                one.rms_distances.tolist(),
                one.force_errors.tolist(),
                strict=True,
            )
        ],
        "warnings": [f"{who}: {warning}" for who, path in result.solutions.items() for warning in path.warnings],
    }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
