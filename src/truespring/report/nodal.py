"""Stress, stretch and energy density at the nodes of a body, as means over its elements, for colours."""

from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints, in_space
from truespring.equilibrium import Solution, State
from truespring.mesh import Mesh
from truespring.potential import Visible

# Energies of cells that miss more than this share of the stored energy do not say where it is.
_MISSING = 1e-6


class Field(NamedTuple):
    """A quantity: its name in words, its SI unit ("" for a ratio), and the value of an undeformed body."""

    label: str
    unit: str
    at_rest: float


#: Quantities by the names of `node_fields`.
FIELDS: Mapping[str, Field] = {
    "stress": Field("von Mises stress", "Pa", 0.0),
    "stretch": Field("largest principal stretch", "", 1.0),
    "energy": Field("energy density", "J/m³", 0.0),
}


def node_fields(path: Solution, state: State) -> dict[str, Floats]:
    """Return what is known of FIELDS at the nodes of a solid or plane body, shape (n_nodes,) each.

    * stress: von Mises, of the mean of the true stress of the elements at a node. The stress of an element that has
      springs only is their virial stress, sum(t l n n) / v with tension t, length l and direction n of each spring and
      the volume v (Thompson, Plimpton, Mattson, General formulation of pressure and stress tensor for arbitrary
      many-body interaction potentials, J. Chem. Phys. 131 (2009) 154107); in plane stress with the undeformed
      thickness, in plane strain not known.
    * stretch: the largest singular value of the deformation gradient of the elements, in the plane of a plane body.
    * energy: stored energy per undeformed volume [J/m^3]; not known where cells do not hold all of it.

    Means over elements are weighted by undeformed volume.
    """
    mesh = path.problem.mesh
    if mesh.element_dim != mesh.dim or path.is_cloud:
        return {}
    found = {"stretch": _mean(mesh, np.linalg.norm(_gradients(mesh, state.positions), ord=2, axis=(1, 2)))}
    if not isinstance(path.potential, Visible) or len(state.all_positions) != mesh.n_nodes:
        return found
    fields = path.potential.cell_fields(state.all_positions)
    lines, elements = _divided(path.potential.cells, fields)
    if "stress" in elements and len(elements["stress"]) == len(mesh.elements):
        found["stress"] = von_mises(_mean(mesh, in_order(mesh, elements["stress"]).reshape(-1, 3, 3)))
    energies = {name: of["strain_energy"] for name, of in (("lines", lines), ("elements", elements)) if _has(of)}
    total = sum(float(one.sum()) for one in energies.values())
    if not energies or abs(total - state.energy) > _MISSING * abs(state.energy):
        return found
    thickness = path.problem.body.thickness
    at_rest, now = (thickness * mesh.measures_at(positions) for positions in (mesh.nodes, state.positions))
    if "elements" in energies and len(energies["elements"]) == len(mesh.elements):
        found["energy"] = _mean(mesh, in_order(mesh, energies["elements"]) / at_rest)
    elif "lines" in energies:
        spread = _Spread.of(mesh, path.potential.cells["line"])
        if spread is None:
            return found
        found["energy"] = _mean(mesh, spread.sums(energies["lines"]) / at_rest)
        section = path.problem.section
        if "tension" in lines and (mesh.dim == 3 or (section is not None and section.free_thickness)):
            virial = spread.sums(_virial(spread.ends, lines["tension"], in_space(state.positions)).reshape(-1, 9))
            found["stress"] = von_mises(_mean(mesh, virial.reshape(-1, 3, 3) / now[:, None, None]))
    return found


def _has(fields: Mapping[str, Floats]) -> bool:
    return "strain_energy" in fields


def _divided(cells: Mapping[str, Ints], fields: Mapping[str, Floats]) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Return the fields of lines and those of elements, without fields that are nowhere known."""
    is_line = np.concatenate([np.full(len(nodes), kind == "line") for kind, nodes in cells.items()])
    both = [{name: values[chosen] for name, values in fields.items()} for chosen in (is_line, ~is_line)]
    lines, elements = ({name: one for name, one in of.items() if np.isfinite(one).all() and len(one)} for of in both)
    return lines, elements


def in_order(mesh: Mesh, values: Floats) -> Floats:
    """Return values of elements in the order of `mesh.cells` in that of the mesh."""
    found = np.empty_like(values)
    found[np.concatenate([numbers for numbers, _ in mesh.blocks])] = values
    return found


def _mean(mesh: Mesh, values: Floats) -> Floats:
    """Return the mean over the elements at each node, weighted by volume, shape (n_nodes, ...)."""
    weights = mesh.measures_at(mesh.nodes)
    flat = values.reshape(len(values), -1) * weights[:, None]
    sums = np.zeros((mesh.n_nodes, flat.shape[1]))
    total = np.zeros(mesh.n_nodes)
    for numbers, part in mesh.blocks:
        for corner in part.elements.T:
            np.add.at(sums, corner, flat[numbers])
            np.add.at(total, corner, weights[numbers])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((sums / total[:, None]).reshape(-1, *values.shape[1:]))


def _gradients(mesh: Mesh, positions: Floats) -> Floats:
    """Return the deformation gradient that fits the nodes of each element best [-], shape (n_elements, dim, dim)."""
    found = np.empty((len(mesh.elements), mesh.dim, mesh.dim))
    for numbers, part in mesh.blocks:
        rest, now = (
            at[part.elements] - at[part.elements].mean(axis=1, keepdims=True) for at in (mesh.nodes, positions)
        )
        found[numbers] = np.einsum("eai,eaj->eij", now, rest) @ np.linalg.inv(np.einsum("eai,eaj->eij", rest, rest))
    return found


class _Spread(NamedTuple):
    """Springs as parts of the elements that have both of their nodes, with equal shares.

    Attributes:
        ends: node numbers of the springs, shape (n_springs, 2).
        springs, elements: the parts, shape (n_parts,) each.
        shares: of each spring in its parts, shape (n_springs,).
        n_elements: number of elements.
    """

    ends: Ints
    springs: Ints
    elements: Ints
    shares: Floats
    n_elements: int

    @classmethod
    def of(cls, mesh: Mesh, ends: Ints) -> "_Spread | None":
        """Return the parts of springs; None if a spring is in no element."""
        keys = _keys(mesh, ends)
        order = np.argsort(keys)
        springs, elements = [], []
        for numbers, part in mesh.blocks:
            for i, j in combinations(range(part.elements.shape[1]), 2):
                sought = _keys(mesh, part.elements[:, [i, j]])
                at = order[np.searchsorted(keys, sought, sorter=order).clip(max=len(keys) - 1)]
                there = keys[at] == sought
                springs.append(at[there])
                elements.append(numbers[there])
        which = np.concatenate(springs)
        count = np.bincount(which, minlength=len(ends))
        return cls(ends, which, np.concatenate(elements), 1 / count, len(mesh.elements)) if count.all() else None

    def sums(self, values: Floats) -> Floats:
        """Return the sums over the springs of each element, shape (n_elements, ...), of values of springs."""
        found = np.zeros((self.n_elements, *values.shape[1:]))
        np.add.at(found, self.elements, (values.T * self.shares).T[self.springs])
        return found


def _keys(mesh: Mesh, ends: Ints) -> Ints:
    return np.asarray(ends.min(axis=1) * mesh.n_nodes + ends.max(axis=1))


def _virial(ends: Ints, tension: Floats, positions: Floats) -> Floats:
    """Return tension times length times the dyad of the direction of each spring [J], shape (n_springs, 3, 3)."""
    along = positions[ends[:, 1]] - positions[ends[:, 0]]
    return np.asarray(np.einsum("s,si,sj->sij", tension / np.linalg.norm(along, axis=1), along, along))


def von_mises(stress: Floats) -> Floats:
    """Return sqrt(3/2 s : s), s the deviator of the stress, shape (n,)."""
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))))
