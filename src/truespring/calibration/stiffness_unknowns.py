"""Unknown stiffness of springs: k = P c, where c = 1 is the rule."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.calibration.unknowns import Columns, Unknowns, material_name
from truespring.errors import ModelError
from truespring.mesh import Mesh
from truespring.mesh.selections import AXES
from truespring.models import (
    PAIR_LAWS,
    PrescribedSprings,
    SpringNetwork,
    Springs,
    VolumeSprings,
    VolumeTerm,
    shared_springs,
)
from truespring.models.elasticity import lattice_classes
from truespring.models.links import in_a_row, link_vectors
from truespring.models.pair_law import PairLaw
from truespring.models.pair_laws import STRAIGHT
from truespring.problem import Problem
from truespring.study.spring_files import write_spring_files

# Components of a direction below this share of its length are rounding errors; heights closer than this share of the
# shortest spring are equal.
_ROUNDING = 1e-6
# Unknowns with a stiffness below this share of the largest are dropped.
_NO_WEIGHT = 1e-12


@dataclass(frozen=True, eq=False)
class StiffnessUnknowns(Unknowns):
    """Factors on parts of the stiffness of the springs of a rule.

    Attributes:
        springs: node numbers of the springs, shape (n_springs, 2).
        law: force law of the springs, a key of PAIR_LAWS.
        stiffness: P, each spring's stiffness per unknown [N/m], sparse, shape (n_springs, n); its rows sum to the rule.
        kappa: modulus of each element's volume term per unknown [Pa], sparse, shape (n_elements, n); None without one.
    """

    springs: Ints
    law: str
    stiffness: Columns
    kappa: Columns | None = None

    of_what = "the stiffness"

    def model(self, values: Floats, label: str = "springs (calibrated)") -> PrescribedSprings:
        """Return the springs with these unknowns (n,), which `solve` accepts for any problem on the same mesh."""
        kappa = np.zeros(0) if self.kappa is None else self.kappa @ values
        return PrescribedSprings(self.springs, self.stiffness @ values, kappa, label, self.law)

    def potential(self, values: Floats) -> SpringNetwork | VolumeSprings:
        """Return the potential with these unknowns (n,), without the check for mechanisms."""
        network = SpringNetwork(self.problem.mesh.nodes, self.springs, self.stiffness @ values, law=self.law)
        if self.kappa is None:
            return network
        return VolumeSprings(network, VolumeTerm(self.problem, np.asarray(self.kappa @ values)))

    def forces(self, positions: Floats, values: Floats | None = None) -> Columns:
        """Return the derivative of the internal force by each unknown [N], sparse, shape (n_dof, n).

        It does not depend on the values. The internal force is this times the unknowns, at any deformation: spring s
        adds its tension times n to its second node and takes it from its first, the volume term of an element adds
        kappa (V / V0 - 1) dV/dx. Tensions are proportional to the stiffness.
        """
        found = _spring_forces(self.problem.mesh.nodes, self.springs, PAIR_LAWS[self.law], positions) @ self.stiffness
        if self.kappa is not None:
            found = found + self._volume_forces(positions) @ self.kappa
        return sparse.csr_array(found)

    def offset(self, positions: Floats) -> Floats:
        """Return the internal force without the stiffness of the unknowns, zero [N], shape (n_dof,)."""
        return np.zeros(positions.size)

    def lattice(self, values: Floats) -> tuple[Ints, Floats]:
        """Return springs, shape (n_springs, 2), and their stiffness over that of the rule [-], shape (n_springs,)."""
        rule, now = self.stiffness @ self.start, self.stiffness @ values
        return self.springs, np.divide(now, rule, out=np.ones_like(rule), where=np.abs(rule) > 0)

    def write(self, values: Floats, file: Path, volume: Path) -> tuple[Path, ...]:
        """Write the springs to a CSV file, and the volume term, if any, to `volume`; return the files written."""
        return write_spring_files(self.model(values), file, volume)

    def entry(self, study: dict[str, Any], name: str, values: Floats, files: Sequence[str]) -> dict[str, Any]:
        """Return the entry of the calibrated springs for the `[models]` of a study: a table of `files`."""
        stiffness = {"file": files[0], **({"volume": files[1]} if len(files) > 1 else {})}
        entry: dict[str, Any] = {"kind": "springs", "stiffness": stiffness}
        if self.law != STRAIGHT:
            entry["law"] = self.law
        if (self.stiffness @ values < 0).any():
            entry["allow_negative"] = True
        return entry

    def _volume_forces(self, positions: Floats) -> Columns:
        values = self._unit_term.element_forces(positions)
        elements, dim = self.problem.mesh.elements, positions.shape[1]
        rows = (elements[:, :, None] * dim + np.arange(dim)).reshape(values.shape)
        columns = np.repeat(np.arange(len(elements)), values.shape[1])
        return sparse.csr_array((values.ravel(), (rows.ravel(), columns)), shape=(positions.size, len(elements)))

    @cached_property
    def _unit_term(self) -> VolumeTerm:
        return VolumeTerm(self.problem, np.ones(len(self.problem.mesh.elements)))


def _spring_forces(nodes: Floats, springs: Ints, law: PairLaw, positions: Floats) -> Columns:
    """Return the derivative of the internal force by the stiffness of each spring [m], shape (n_dof, n_springs)."""
    first, second = springs.T
    rest = np.linalg.norm(nodes[second] - nodes[first], axis=1)
    across = positions[second] - positions[first]
    length = np.linalg.norm(across, axis=1)
    pull = (law.tension(np.ones(len(springs)), rest, length, nodes.shape[1]) / length)[:, None] * across
    dim = nodes.shape[1]
    rows = [(ends[:, None] * dim + np.arange(dim)).ravel() for ends in (second, first)]
    columns = np.repeat(np.arange(len(springs)), dim)
    return sparse.csr_array(
        (np.concatenate([pull.ravel(), -pull.ravel()]), (np.concatenate(rows), np.tile(columns, 2))),
        shape=(nodes.size, len(springs)),
    )


#: Groups of springs: their names, and the number of the group of each link of each element, (n_elements * links,).
Groups = tuple[list[str], Ints]


def stiffness_unknowns(
    problem: Problem, springs: Springs, kind: str, groups: Callable[[Problem, Ints, Ints], Groups]
) -> StiffnessUnknowns:
    """Return the unknowns of groups of springs; `groups` has the springs and the number of the spring of each link.

    Raises ModelError for a kind or a rule that does not fit the mesh.
    """
    springs.potential(problem)  # raises the usual errors
    pairs, place = shared_springs(problem.mesh)
    by_link = in_a_row(problem.mesh, springs.element_stiffness(problem))
    if springs.sharing == "single":
        by_link = by_link / np.bincount(place)[place]
    labels, group = groups(problem, np.asarray(pairs), np.asarray(place))
    shape = (len(pairs), len(labels))
    law = springs.law or STRAIGHT
    stiffness = sparse.csr_array((by_link, (place, group)), shape=shape)
    kappas = springs.kappa(problem) if springs.volume else np.zeros(len(problem.mesh.elements))
    if not kappas.any():
        return _weighted(
            StiffnessUnknowns(kind, tuple(labels), problem, np.asarray(pairs, dtype=np.int64), law, stiffness)
        )
    terms, of = _volume_groups(problem, kind)
    elements = np.arange(len(kappas))
    kappa = sparse.csr_array((kappas, (elements, len(labels) + of)), shape=(len(kappas), len(labels) + len(terms)))
    wide = sparse.csr_array((stiffness.data, stiffness.indices, stiffness.indptr), shape=(len(pairs), kappa.shape[1]))
    return _weighted(
        StiffnessUnknowns(kind, (*labels, *terms), problem, np.asarray(pairs, dtype=np.int64), law, wide, kappa),
    )


def _weighted(unknowns: StiffnessUnknowns) -> StiffnessUnknowns:
    """Return the unknowns without those of springs to which the rule gives no stiffness."""
    weight = np.zeros(len(unknowns), dtype=bool)
    for part in (unknowns.stiffness, unknowns.kappa):
        if part is not None:
            size = np.asarray(abs(part).max(axis=0).todense()).ravel()
            weight |= size > _NO_WEIGHT * size.max()
    kept = np.flatnonzero(weight)
    return StiffnessUnknowns(
        unknowns.kind,
        tuple(unknowns.names[number] for number in kept),
        unknowns.problem,
        unknowns.springs,
        unknowns.law,
        sparse.csr_array(unknowns.stiffness[:, kept]),
        None if unknowns.kappa is None else sparse.csr_array(unknowns.kappa[:, kept]),
    )


def classes(problem: Problem, pairs: Ints, place: Ints) -> Groups:
    """Group edges, face diagonals and body diagonals; on lattices, edges by axis."""
    words = []
    for numbers, part in problem.mesh.blocks:
        kind = part.kind
        own = ["edge"] * len(kind.edges) + ["diagonal"] * len(kind.diagonals) + ["body"] * len(kind.body_diagonals)
        words.append(np.tile(np.array(own, dtype=object), len(numbers)))
    per_link = np.concatenate(words)
    if lattice_classes(problem.mesh) is not None:
        axis = _axis_of(problem.mesh)
        for number, name in enumerate(AXES[: problem.mesh.dim]):
            per_link[(axis == number) & (per_link == "edge")] = f"edge along {name}"
    return _numbered(per_link)


def regions(problem: Problem, pairs: Ints, place: Ints) -> Groups:
    """Group by class and material."""
    if len(problem.materials) < 2:
        raise ModelError("unknowns = 'region' needs a body of several materials, this one has one: use 'class'")
    names, group = classes(problem, pairs, place)
    numbers = problem.material_numbers
    blocks = problem.mesh.blocks
    material = np.concatenate([np.repeat(numbers[own], len(part.kind.links)) for own, part in blocks])
    return _numbered(
        np.array(
            [f"{names[g]}, {material_name(m)}" for g, m in zip(group.tolist(), material.tolist(), strict=True)],
            dtype=object,
        )
    )


def directions_and_rows(problem: Problem, pairs: Ints, place: Ints) -> Groups:
    """Group springs by height and direction, up to signs of components."""
    mesh = problem.mesh
    if mesh.element not in ("quadrilateral", "hexahedron") or not _axis_aligned(mesh):
        raise ModelError(
            "unknowns = 'direction-row' needs rectangles or bricks along the axes: use 'class' or 'spring'"
        )
    along = _components(mesh)
    names = np.array(
        ["along " + "".join(a for a, there in zip(AXES, row, strict=False) if there) for row in along], dtype=object
    )
    height = mesh.nodes[pairs, 1].mean(axis=1)
    smallest = np.linalg.norm(mesh.nodes[pairs[:, 1]] - mesh.nodes[pairs[:, 0]], axis=1).min()
    heights = np.round((height - height.min()) / (_ROUNDING * smallest)).astype(np.int64)[place]
    row = np.zeros(len(place), dtype=np.int64)
    for name in set(names):
        own = names == name
        row[own] = np.unique(heights[own], return_inverse=True)[1] + 1
    return _numbered(np.array([f"{name} in row {r}" for name, r in zip(names, row, strict=True)], dtype=object))


def each_spring(problem: Problem, pairs: Ints, place: Ints) -> Groups:
    """Use one group per spring."""
    return [f"spring {a}-{b}" for a, b in pairs.tolist()], np.asarray(place, dtype=np.int64)


def _volume_groups(problem: Problem, kind: str) -> Groups:
    """Return the groups of the volume term: one, or one per region."""
    if kind == "region":
        used = [f"volume term, {material_name(number)}" for number in range(len(problem.materials))]
        return used, problem.material_numbers
    return ["volume term"], np.zeros(len(problem.mesh.elements), dtype=np.int64)


def _numbered(names: Any) -> Groups:
    """Return the distinct names in natural order, and the number of each name."""
    found = sorted(set(names), key=lambda name: [int(part) if part.isdigit() else part for part in _parts(name)])
    number = {name: place for place, name in enumerate(found)}
    return found, np.array([number[name] for name in names], dtype=np.int64)


def _parts(name: str) -> list[str]:
    head, _, row = name.rpartition("row ")
    return [head, row] if row.isdigit() else [name, "0"]


def _components(mesh: Mesh) -> Bools:
    """Return which components of each link of each element are not zero, shape (n_elements * links, dim)."""
    vectors = np.abs(np.concatenate([link_vectors(part).reshape(-1, mesh.dim) for _, part in mesh.blocks]))
    return np.asarray(vectors > _ROUNDING * vectors.max(axis=1, keepdims=True))


def _axis_of(mesh: Mesh) -> Ints:
    """Return the axis of each link, -1 if it is along none, shape (n_elements * links,)."""
    along = _components(mesh)
    return np.where(along.sum(axis=1) == 1, along.argmax(axis=1), -1)


def _axis_aligned(mesh: Mesh) -> bool:
    n_links, n_edges = len(mesh.kind.links), len(mesh.kind.edges)
    return bool((_axis_of(mesh).reshape(-1, n_links)[:, :n_edges] >= 0).all())
