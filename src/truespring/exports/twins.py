"""Bodies of keyword decks for springs that SPRINGA elements cannot express: hyperelastic elements, and springs.

The neo-Hookean law of both programs splits off the volume; it equals that of Gaussian springs at small strain. An
element of the springs has the Lamé constants mu and -mu at every point, and lam + mu for the volume of the whole
element; that is written as two elements on the same nodes, fully integrated and of mean strain. What the springs have
of stiffness against hourglass modes beyond that are SPRING2 elements, linear springs of one direction each, which a
rotation of the body does not change.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Refined
from truespring.exports.continuum import element_blocks, fem_element
from truespring.exports.decks import Dialect, Twin, joined, real
from truespring.exports.exported import Exported
from truespring.exports.spring_elements import spring_twin
from truespring.models.gaussian_rule import gaussian_stiffness
from truespring.models.gaussian_weights import HOURGLASS_LIMITS
from truespring.problem import Problem

#: Elements of mean strain, by the fully integrated ones; simplices of first order have no other strain.
MEAN_STRAIN = {"C3D8": "C3D8R", "CPE4": "CPE4R"}
# Stiffness of springs, over the largest, below which they are left out as rounding.
_ROUNDING = 1e-9


@dataclass
class _Body:
    """The lines of a deck under construction, and the springs that are still to be added.

    Attributes:
        thickness: of plane elements [m], None in space.
        force_unit: unit of force [N].
        n: number of elements so far.
        sets: names of the sets of elements so far.
        pairs, stiffness: nodes of springs in each direction, counted from 0, and their stiffness [N/m].
    """

    thickness: float | None
    force_unit: float
    n: int = 0
    lines: list[str] = field(default_factory=list)
    sets: list[str] = field(default_factory=list)
    pairs: list[Ints] = field(default_factory=list)
    stiffness: list[Floats] = field(default_factory=list)

    def add_elements(self, kind: str, nodes: Ints, c10: float, d1: float) -> None:
        """Add hyperelastic elements; nodes count from 0, C10 is in Pa and D1 in 1/Pa."""
        name = f"T{len(self.sets) + 1}"
        rows = np.column_stack([self.n + np.arange(len(nodes)), nodes]) + 1
        self.lines += [
            f"*ELEMENT, TYPE={kind}, ELSET={name}",
            *map(joined, rows.tolist()),
            f"*MATERIAL, NAME=M{name}",
            "*HYPERELASTIC, NEO HOOKE",
            f"{real(c10 / self.force_unit)}, {real(d1 * self.force_unit)}",
            f"*SOLID SECTION, ELSET={name}, MATERIAL=M{name}",
            *([] if self.thickness is None else [real(self.thickness)]),
        ]
        self.sets.append(name)
        self.n += len(nodes)

    def add_laplacian(self, nodes: Ints, matrices: Floats) -> None:
        """Add springs of minus the off-diagonal entries of matrices of elements [N/m], shape (n, k, k)."""
        first, second = np.triu_indices(nodes.shape[1], 1)
        self.add_springs(np.stack([nodes[:, first], nodes[:, second]], axis=2), -matrices[:, first, second])

    def add_springs(self, pairs: Ints, stiffness: Floats) -> None:
        """Add springs to those still to be written; shapes (..., 2) and (...)."""
        self.pairs.append(np.sort(pairs.reshape(-1, 2), axis=1))
        self.stiffness.append(stiffness.ravel())

    def write_springs(self, dim: int, largest: float) -> None:
        """Write the sum of the springs of each pair as SPRING2 elements; those below rounding are left out."""
        if not self.pairs:
            return
        pairs, place = np.unique(np.concatenate(self.pairs), axis=0, return_inverse=True)
        total = np.bincount(place.ravel(), np.concatenate(self.stiffness), len(pairs))
        kept = (np.abs(total) > _ROUNDING * largest) & (pairs[:, 0] != pairs[:, 1])
        members: dict[str, list[tuple[int, int]]] = {}
        for (first, second), value in zip(pairs[kept].tolist(), total[kept].tolist(), strict=True):
            members.setdefault(f"{value / self.force_unit:.8e}", []).append((first + 1, second + 1))
        for group, (stiffness, ends) in enumerate(members.items(), 1):
            for axis in range(1, dim + 1):
                name = f"H{group}X{axis}"
                self.lines.append(f"*ELEMENT, TYPE=SPRING2, ELSET={name}")
                self.lines += (f"{self.n + row}, {first}, {second}" for row, (first, second) in enumerate(ends, 1))
                self.lines += [f"*SPRING, ELSET={name}", f"{axis}, {axis}", stiffness]
                self.n += len(ends)

    def close(self) -> list[str]:
        """Return the lines, with the set BODY of all elements of the continuum."""
        rows = (joined(self.sets[first : first + 16]) for first in range(0, len(self.sets), 16))
        return [*self.lines, *(["*ELSET, ELSET=BODY", *rows] if self.sets else [])]


def largest_modulus(problem: Problem) -> float:
    """Return the largest lam + mu of the materials [Pa]."""
    return max(material.lame.lam + material.lame.mu for material in problem.materials)


def gaussian_twin(dialect: Dialect, exported: Exported) -> Twin:
    """Return Gaussian springs as hyperelastic elements with the same stiffness at small strain."""
    problem = exported.problem
    finer = exported.refined
    body = _body(problem, dialect.force_unit)
    overlaid = dialect.solids.overlaid if one_volume(problem) else frozenset()
    for kind, nodes, lam, mu in _parts(problem, finer):
        program = dialect.solids.names.get(kind, kind)
        if kind not in overlaid:
            body.add_elements(program, nodes, mu / 2, 2 / (lam + 2 / 3 * mu))
            continue
        body.add_elements(program, nodes, mu / 2, -6 / mu)
        _add_mean_strain(dialect, body, problem, kind, nodes, lam + mu)
    if finer is None:
        stiffness = np.asarray(exported.springs.arrays["stiffness"])
        body.add_springs(np.asarray(exported.springs.arrays["springs"]), stiffness)
        for pairs, own in _of_elements(problem):
            body.add_springs(pairs, -own)
        body.write_springs(problem.mesh.dim, float(np.abs(stiffness).max()))
    loading = problem.loading if finer is None else finer.loading
    return Twin(exported.nodes, body.close(), loading)


def volume_twin(dialect: Dialect, exported: Exported) -> Twin:
    """Return springs as SPRINGA elements, and the volume term as elements without shear stiffness.

    The volume term is the volume function of the programs, (J - 1)^2 / D1 with D1 = 2 / kappa.
    """
    problem, network = exported.problem, exported.network
    springs = spring_twin(problem, network, dialect.force_unit)
    body = _body(problem, dialect.force_unit)
    body.n = len(network.springs)
    kappa = np.asarray(exported.springs.arrays["kappa"])
    for kind, numbers, nodes in element_blocks(problem):
        plane = f"CPE{kind.removeprefix(problem.section.elements)}" if problem.mesh.dim == 2 else kind  # type: ignore[union-attr]
        values, which = np.unique(kappa[numbers], return_inverse=True)
        for number, value in enumerate(values.tolist()):
            if value:
                _add_mean_strain(dialect, body, problem, plane, nodes[which.ravel() == number], value)
    body.write_springs(problem.mesh.dim, float(np.abs(network.stiffness).max()))
    return replace(springs, model=[*springs.model, *body.close()])


def one_volume(problem: Problem) -> bool:
    """Return whether elements of mean strain have the volume of the springs' elements: not in plane stress."""
    assert problem.section is not None
    return not problem.section.free_thickness


def _body(problem: Problem, force_unit: float) -> _Body:
    assert problem.section is not None
    return _Body(problem.section.thickness if problem.mesh.dim == 2 else None, force_unit)


def _parts(problem: Problem, finer: Refined | None) -> Iterator[tuple[str, Ints, float, float]]:
    """Yield type, nodes, lam and mu [Pa] of the elements of each kind and material."""
    blocks = element_blocks(problem)
    if finer is not None:
        blocks = [(fem_element(problem, "quadratic"), np.arange(len(finer.elements)), finer.elements)]
    for kind, numbers, nodes in blocks:
        for place, material in enumerate(problem.materials):
            own = nodes[problem.material_numbers[numbers] == place]
            if len(own):
                yield kind, own, material.lame.lam, material.lame.mu


def _add_mean_strain(dialect: Dialect, body: _Body, problem: Problem, kind: str, nodes: Ints, modulus: float) -> None:
    """Add elements that resist only their change of volume, with a modulus [Pa], less the program's own control."""
    body.add_elements(MEAN_STRAIN.get(kind, kind), nodes, dialect.solids.least_shear * modulus, 2 / modulus)
    if kind not in MEAN_STRAIN or dialect.solids.control is None:
        return
    corners = np.zeros((*nodes.shape, 3))
    corners[:, :, : problem.mesh.dim] = problem.mesh.nodes[nodes]
    if body.thickness is not None:
        corners[:, :, 2] = body.thickness / 2
    body.add_laplacian(nodes, -dialect.solids.control(corners, np.full(len(nodes), modulus)))


def _of_elements(problem: Problem) -> Iterator[tuple[Ints, Floats]]:
    """Yield the springs that finite elements contain: pairs of nodes, shape (n, links, 2), and stiffness [N/m]."""
    for _, part in problem.blocks:
        hourglass = 1.0 if part.mesh.element in HOURGLASS_LIMITS else None
        links = np.array(part.mesh.kind.links)
        yield part.mesh.elements[:, links], gaussian_stiffness(part, hourglass)[:, : len(links)]


def twin_types(dialect: Dialect, exported: Exported) -> tuple[str, ...]:
    """Return the types of the elements of a twin of Gaussian springs, those of mean strain aside."""
    kinds = _kinds(exported)
    return tuple(dialect.solids.names.get(kind, kind) for kind in kinds)


def explained(dialect: Dialect, exported: Exported) -> Sequence[str]:
    """Return sentences on the elements of a twin of Gaussian springs."""
    overlaid = one_volume(exported.problem) and any(kind in dialect.solids.overlaid for kind in _kinds(exported))
    return dialect.solids.of_overlaid if overlaid else dialect.solids.of_others


def _kinds(exported: Exported) -> tuple[str, ...]:
    return tuple(dict.fromkeys(kind for kind, *_ in _parts(exported.problem, exported.refined)))
