"""Springs as plain arrays: an .npz and a .json of the same keys."""

import io
import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from truespring.conditions import Refined
from truespring.exports.exported import Exported
from truespring.mesh import ELEMENT_KINDS
from truespring.models import LAWS

# The unit of each key that has one.
_UNITS = {
    "nodes": "m",
    "stiffness": "N/m",
    "rest_length": "m",
    "kappa": "Pa",
    "coupling": "J/m^4",
    "volume": "m^3",
    "lam": "Pa",
    "mu": "Pa",
    "link_weights": "m",
    "fibre_weights": "m",
    "k1": "Pa",
    "gradients": "1/m",
    "point_volume": "m^3",
    "prescribed_displacement": "m",
    "external_force": "N",
    "displacement": "m",
    "reaction": "N",
    "energy": "J",
    "young": "Pa",
    "density": "kg/m^3",
    "thickness": "m",
    "mass": "kg",
    "start": "m",
    "damping": "1/s",
    "time_step": "s",
    "settled": "s",
}


def npz(exported: Exported, more: Mapping[str, Any] | None = None) -> Mapping[str, str | bytes]:
    """Return springs.npz, which loads without pickle, with `more` values; unknown ones are NaN or empty strings."""
    values = _values(exported) | dict(more or {})
    values["units"] = [f"{name}: {unit}" for name, unit in _units(values).items()]
    arrays: dict[str, Any] = {name: _array(value) for name, value in values.items()}
    file = io.BytesIO()
    np.savez(file, **arrays)
    return {"springs.npz": file.getvalue()}


def as_json(exported: Exported) -> Mapping[str, str | bytes]:
    """Return springs.json, one key per line; arrays are nested lists, unknown values are null."""
    values = _values(exported)
    values["units"] = _units(values)
    lines = (f"{json.dumps(name)}: {json.dumps(_plain(value), allow_nan=False)}" for name, value in values.items())
    return {"springs.json": "{\n" + ",\n".join(lines) + "\n}\n"}


def _values(exported: Exported) -> dict[str, Any]:
    """Return the values of both files by key; see docs/export/arrays.md."""
    problem, state = exported.problem, exported.path.states[-1]
    mesh, materials = problem.mesh, problem.materials
    return {
        "title": exported.title,
        "truespring": version("truespring"),
        "model": exported.path.label,
        "nodes": mesh.nodes,
        **exported.springs.arrays,
        **_refined(exported),
        "held": exported.held,
        "prescribed_displacement": exported.motion,
        "external_force": exported.external_force,
        "status": str(exported.path.status),
        "load_factor": state.load_factor,
        "displacement": state.displacement,
        "reaction": state.reaction,
        "energy": state.energy,
        "probe": exported.probe,
        "element": mesh.element,
        "elements": mesh.elements,
        "section": exported.section,
        "thickness": None if problem.section is None else problem.section.thickness,
        "material_numbers": problem.material_numbers,
        "young": [material.young for material in materials],
        "poisson": [material.poisson for material in materials],
        "density": [material.density for material in materials],
        "header": list(exported.header),
    }


def _refined(exported: Exported) -> dict[str, Any]:
    """Return supports, loads and displacement of all nodes of a potential that has more nodes than the mesh."""
    potential, state = exported.path.potential, exported.path.states[-1]
    if not isinstance(potential, Refined):
        return {}
    loading = potential.loading
    return {
        "all_nodes": potential.nodes,
        "all_held": loading.held,
        "all_prescribed_displacement": loading.motion(),
        "all_external_force": exported.force_of(loading),
        "all_displacement": state.all_positions - potential.nodes,
    }


def _units(values: Mapping[str, Any]) -> dict[str, str]:
    """Return the unit of each key that has one; keys may start with "all_" and end with a kind of element."""
    constants = {name: one.unit for law in LAWS.values() for name, one in law.constants.items() if one.dimension}
    known = constants | _UNITS
    plain = {name: name.removeprefix("all_") for name in values}
    for kind in ELEMENT_KINDS:
        plain = {name: short.removesuffix(f"_{kind}") for name, short in plain.items()}
    return {name: known[short] for name, short in plain.items() if short in known}


def _array(value: Any) -> np.ndarray[Any, Any]:
    """Return a value as an array that is not of objects: None becomes NaN."""
    several = value if isinstance(value, list) else [value]
    if any(one is None for one in several):
        return np.asarray(value, dtype=np.float64)
    return np.asarray(value)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value
