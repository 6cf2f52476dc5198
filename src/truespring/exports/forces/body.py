"""Energy and forces of springs exported by truespring, from the arrays of springs.npz; needs only NumPy.

Formulas: docs/export/arrays.md of truespring.

    body = Body.load("springs.npz")
    energy, gradient = body.evaluate(body.nodes)  # [J], [N]; the force of the springs on the nodes is -gradient
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from truespring.exports.forces.elements import (
    Coupled,
    Elements,
    Forms,
    Measure,
    Nodes,
    Points,
    Springs,
    VolumeTerm,
    ZeroLengthSprings,
    floats,
)
from truespring.exports.forces.laws import Array, Law


class Body:
    """Springs and elements.

    Attributes:
        nodes: undeformed positions [m], shape (n_nodes, dim).
        held: whether the displacement is prescribed, shape (n_nodes, dim).
        motion: prescribed displacement at full load [m], zero where free.
        force: nodal forces at full load [N].
        displacement: that of the equilibrium that truespring found [m].
        parts: what the springs and elements consist of.
    """

    def __init__(self, arrays: Mapping[str, Any]) -> None:
        every = "all_" if "all_nodes" in arrays else ""  # with the midpoints of the edges
        self.nodes = np.asarray(arrays[f"{every}nodes"], dtype=float)
        self.held = np.asarray(arrays[f"{every}held"], dtype=bool)
        self.motion = np.asarray(arrays[f"{every}prescribed_displacement"], dtype=float)
        self.force = np.asarray(arrays[f"{every}external_force"], dtype=float)
        self.displacement = np.asarray(arrays[f"{every}displacement"], dtype=float)
        self.probe = int(arrays["probe"])
        self.parts = tuple(_parts(arrays, len(self.nodes)))

    @staticmethod
    def load(file: "str | Path") -> "Body":
        """Read springs.npz."""
        with np.load(file, allow_pickle=False) as arrays:
            return Body({name: arrays[name] for name in arrays.files})

    def evaluate(self, positions: Array) -> tuple[float, Array]:
        """Return the energy [J] and its gradient [N], shape (n_nodes, dim); NaN if an element is inverted."""
        x = np.ascontiguousarray(np.asarray(positions, dtype=float).T)
        gradient = np.zeros_like(x)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            energy = sum(part.add(x, gradient) for part in self.parts)
        return float(energy), np.ascontiguousarray(gradient.T)


def _parts(arrays: Mapping[str, Any], n_nodes: int) -> Iterator[Any]:
    """Yield springs, then elements by kind."""
    section = str(arrays["section"])
    constant = str(arrays.get("law", "neo-hookean")) == "neo-hookean"
    if "stiffness" in arrays and constant:
        first, second = np.asarray(arrays["springs"]).T
        stiffness, rest = (np.asarray(arrays[name], dtype=float) for name in ("stiffness", "rest_length"))
        nodes = Nodes(np.stack([first, second]), n_nodes)
        law = (str(arrays.get("force_law", "straight")), int(arrays.get("dimension", 3)))
        yield Springs(nodes, stiffness, rest, *law) if rest.any() else ZeroLengthSprings(nodes, stiffness)
    for kind in dict.fromkeys(_kind(name) for name in arrays if name.startswith(("mu", "kappa", "coupling"))):
        own = {name.removesuffix(kind): value for name, value in arrays.items() if name.endswith(kind)}
        elements = own.get("all_elements", own.get("corners", arrays["elements"]))
        nodes = Nodes(np.ascontiguousarray(np.asarray(elements).T), n_nodes)
        thickness = float(arrays["thickness"])
        if "coupling" in own:
            yield Coupled.of(nodes, np.asarray(arrays[f"{'all_' * ('all_nodes' in arrays)}nodes"]).T, own)
        elif "gradients" in own:
            gradients, volumes = floats(own, "gradients", "point_volume")
            yield Points(nodes, gradients, volumes, Law(section, "neo-hookean", own), own)
        elif "kappa" in own:
            yield VolumeTerm(nodes, _measure(own, thickness), *floats(own, "volume", "kappa"))
        else:
            (volume,), law_ = floats(own, "volume"), Law(section, str(arrays["law"]), own)
            yield Elements(nodes, _measure(own, thickness), volume, law_, _forms(own, constant), own)


def _kind(name: str) -> str:
    """Return what follows the name of a key: "_KIND" on a mesh of several kinds of elements, else nothing."""
    return "".join(name.partition("_")[1:])


def _measure(own: Mapping[str, Any], thickness: float) -> Measure:
    """Return the volume of an element of one kind."""
    simplices = np.asarray(own["simplices"])
    factor = {3: 0.5, 4: 1 / 6}[simplices.shape[1]]
    return Measure(simplices, float(own["simplex_weight"]) * thickness * factor)


def _forms(own: Mapping[str, Any], constant: bool) -> Forms | None:
    """Return the squared stretches of elements as sums over links; None with springs of constant stiffness alone."""
    if "links" not in own:
        return None
    trace = None if constant else np.asarray(own["link_weights"]).T
    return Forms(np.asarray(own["links"]), trace, tuple(one.T for one in np.asarray(own.get("fibre_weights", ()))))
