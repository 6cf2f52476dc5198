"""Springs as plain arrays: an .npz and a .json of the same keys."""

import io
import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from truespring.exports.exported import Exported

# The unit of each key that has one.
_UNITS = {
    "nodes": "m",
    "stiffness": "N/m",
    "rest_length": "m",
    "kappa": "Pa",
    "coupling": "J/m^4",
    "prescribed_displacement": "m",
    "external_force": "N",
    "displacement": "m",
    "reaction": "N",
    "energy": "J",
    "young": "Pa",
    "density": "kg/m^3",
    "thickness": "m",
}


def npz(exported: Exported) -> Mapping[str, str | bytes]:
    """Return springs.npz, which loads without pickle; unknown values are NaN or empty strings."""
    values = _values(exported)
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


def _units(values: Mapping[str, Any]) -> dict[str, str]:
    known = {name: _UNITS.get(name.split("_")[0] if name.startswith("coupling") else name) for name in values}
    return {name: unit for name, unit in known.items() if unit is not None}


def _array(value: Any) -> np.ndarray[Any, Any]:
    """Return a value as an array that is not of objects: None becomes NaN."""
    several = value if isinstance(value, list) else [value]
    if any(one is None for one in several):
        return np.asarray(value, dtype=np.float64)
    return np.asarray(value)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value
