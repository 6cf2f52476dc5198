"""A block of boundary elements, coupled with springs in the rest of the body."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import ModelError, nearest
from truespring.mesh import Mesh, Selection, select_elements
from truespring.models.block import inner_nodes, make_block
from truespring.models.frames import AtRest, Frame, Tangent, Turning
from truespring.models.model import Model
from truespring.models.network import SpringNetwork
from truespring.models.rules import RULES, require_body
from truespring.models.springs import Springs
from truespring.potential import SparseMatrix
from truespring.problem import Problem


@dataclass(frozen=True)
class BemSprings(Model):
    """A block of boundary elements and springs in all other elements, coupled at shared nodes.

    The block is linear elastic, modelled by its surface (see `make_block`). Springs on the interface have the stiffness
    of the elements outside the block. The idea is from Zhu and Gu, "A hybrid deformable model for real-time surgical
    simulation" (2012). The formulas of their coupling were not available; this division of the body is an
    interpretation for static equilibrium.

    Attributes:
        block: elements of the block: an element group, a Box that contains their centres, or element numbers.
        rule: rule of the springs, a key of RULES; not a coupled one.
        corotated: let the block rotate as a whole, by the rotation that fits its surface best. Otherwise rotations
            cause strain, as in linear elasticity.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> ts.solve(problem, ts.BemSprings(block=ts.Box((0.02, 0.0), (0.04, 0.01))))
        Solution(BEM + springs (isotropic), converged, 11 states up to load factor 1)
    """

    block: Selection
    rule: str = "isotropic"
    corotated: bool = False

    def __post_init__(self) -> None:
        plain = [name for name, rule in RULES.items() if not rule.coupled]
        if self.rule not in RULES:
            raise ModelError(
                f"rule = {self.rule!r} is unknown{nearest(str(self.rule), plain)}; allowed: {', '.join(plain)}"
            )
        if RULES[self.rule].coupled:
            raise ModelError(
                f"rule = '{self.rule}' has coupled springs, a block requires plain ones; allowed: {', '.join(plain)}"
            )

    kind = "bem-springs"

    @property
    def label(self) -> str:
        """Name in figures and tables."""
        return f"BEM + springs ({self.rule}{', corotated' if self.corotated else ''})"

    def potential(self, problem: Problem) -> "BlockSprings":
        """Return the potential of block and springs; raise ModelError if the block does not fit the problem."""
        chosen, network = self._parts(problem)
        block = make_block(problem, np.flatnonzero(chosen))
        return BlockSprings(problem.mesh, chosen, network, Turning(block) if self.corotated else AtRest(block))

    def check(self, problem: Problem) -> None:
        """Raise ModelError if the block does not fit the problem; fast, no integrals are computed."""
        self._parts(problem)

    def _parts(self, problem: Problem) -> tuple[Bools, SpringNetwork]:
        """Return whether each element belongs to the block, shape (n_elements,), and the springs of the others."""
        require_body(problem)
        if any(len(set(facet)) < len(facet) for facet in problem.mesh.kind.facets):
            raise ModelError(
                f"boundary elements must be all triangles or all quadrilaterals, but a {problem.mesh.kinds} has both: "
                "use springs or fem"
            )
        chosen = self._chosen(problem)
        _check_inside(problem, inner_nodes(problem.mesh, np.flatnonzero(chosen)))
        return chosen, _springs_beside(problem, self.rule, chosen)

    def _chosen(self, problem: Problem) -> Bools:
        """Return whether each element belongs to the block, shape (n_elements,)."""
        mesh = problem.mesh
        chosen = np.zeros(len(mesh.elements), dtype=bool)
        chosen[select_elements(mesh, self.block)] = True
        if chosen.all():
            raise ModelError("block: it contains all elements, none is left for springs: select a part of the body")
        several = np.unique(problem.material_numbers[chosen])
        if len(several) > 1:
            raise ModelError(
                f"block: its elements have {len(several)} materials, boundary elements require one: select others"
            )
        _check_connected(mesh, chosen)
        return chosen

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return warnings about the springs, as of `Springs`."""
        return tuple(f"outside the block: {text}" for text in Springs(self.rule).warnings(problem))


def _check_connected(mesh: Mesh, chosen: Bools) -> None:
    """Raise ModelError if a block has several parts, or no facet in common with the other elements."""
    nodes, elements = np.unique(mesh.elements[chosen], return_inverse=True)
    n_parts = int(Mesh(mesh.nodes[nodes], elements.reshape(-1, mesh.kind.n_nodes), mesh.element).parts.max()) + 1
    if n_parts > 1:
        raise ModelError(f"block: it has {n_parts} separate parts: select one of them")
    facets, alone = mesh.facets_of(mesh.elements[chosen])
    outside, outside_alone = mesh.facets_of(mesh.elements[~chosen])
    mine = {tuple(facet) for facet in np.sort(facets[alone], axis=1).tolist()}
    if mine.isdisjoint(tuple(facet) for facet in np.sort(outside[outside_alone], axis=1).tolist()):
        raise ModelError(
            "block: it has no facet in common with other elements, so it is not connected with springs: select other "
            "elements"
        )


def _springs_beside(problem: Problem, rule: str, chosen: Bools) -> SpringNetwork:
    """Return the springs of the elements that are not `chosen`."""
    mesh = problem.mesh
    springs = Springs(rule)
    per_element = np.where(chosen[:, None], 0.0, springs.element_stiffness(problem))
    network = springs.network(problem, per_element)
    pairs = np.sort(mesh.elements[~chosen][:, np.array(mesh.kind.links)].reshape(-1, 2), axis=1)
    kept = np.isin(np.sort(network.springs, axis=1) @ [mesh.n_nodes, 1], pairs @ [mesh.n_nodes, 1])
    return SpringNetwork(mesh.nodes, network.springs[kept], network.stiffness[kept], law=network.law)


def _check_inside(problem: Problem, inside: Ints) -> None:
    """Raise ModelError if a load or support acts inside the block."""
    everywhere = next((load.words() for load in problem.loads if load.on is None), None)
    loading = problem.loading
    loaded = np.flatnonzero(loading.force(problem.mesh.nodes)[inside].any(axis=1))
    held = np.flatnonzero(loading.held[inside].any(axis=1))
    if everywhere or loaded.size:
        where = (
            f"{everywhere} acts"
            if everywhere
            else f"a load acts on {loaded.size} nodes, the first is node {inside[loaded[0]]},"
        )
        raise ModelError(
            f"block: {where} inside it, but boundary elements are loaded on their surface only: load the surface, or "
            "select another block"
        )
    if held.size:
        raise ModelError(
            f"block: a support fixes {held.size} of its inner nodes, the first is node {inside[held[0]]}, but boundary "
            "elements are supported on their surface only: select another block, or a support on the surface"
        )


@dataclass(frozen=True, eq=False)
class BlockSprings:
    """The potential of a block and the springs of the other elements, on the nodes of the mesh.

    Attributes:
        mesh: the mesh of the problem.
        chosen: whether each element belongs to the block, shape (n_elements,).
        network: the springs.
        frame: the block in its frame of reference, at rest or corotated.
    """

    mesh: Mesh
    chosen: Bools
    network: SpringNetwork
    frame: Frame

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim)."""
        return self.mesh.nodes

    @property
    def springs(self) -> Ints:
        """Node numbers of the springs, shape (n_springs, 2)."""
        return self.network.springs

    @cached_property
    def _pattern(self) -> "_Union":
        return _Union(self)

    def _local(self, positions: Floats) -> Floats:
        """Return the positions of the block's nodes [m], shape (n_block, dim), surface nodes first."""
        return positions[self.frame.block.numbers]

    def _force(self, positions: Floats) -> Floats:
        """Return the nodal forces of the block in its frame [N], shape (n_block, dim)."""
        return self.frame.block.forces(self.frame.displacement(self._local(positions)))

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        return self.network.energy(positions) + float(self._node_energies(positions).sum())

    def _node_energies(self, positions: Floats) -> Floats:
        """Return half the work of the block's forces at each of its nodes [J], shape (n_block,)."""
        moved = self.frame.displacement(self._local(positions))
        return np.asarray((moved * self.frame.block.forces(moved)).sum(axis=1) / 2)

    def stress(self, positions: Floats) -> Floats:
        """Return tensions of springs and forces of the block in its frame [N], shape (n_springs + n_block * dim,)."""
        return np.concatenate([self.network.stress(positions), self._force(positions).ravel()])

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress extrapolated linearly along `step` [m], in N, shape (n_springs + n_block * dim,)."""
        local, frame = self._local(positions), self.frame
        further = frame.displacement(local) + frame.change(local, step[frame.block.numbers])
        tension = self.network.extrapolated_stress(positions, step)
        return np.concatenate([tension, frame.block.forces(further).ravel()])

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        force = self.network.gradient(positions)
        force[self.frame.block.numbers] += self.frame.gradient(self._local(positions), self._force(positions))
        return force

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress`, as from `stress()`, gives the geometric part."""
        stress = self.stress(positions) if stress is None else stress
        tension, force = np.split(stress, [len(self.springs)])
        local = self._local(positions)
        tangent = self.frame.tangent(local, force.reshape(local.shape))
        return self._pattern.sum(self.network.hessian(positions, tension), tangent)

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the projected Hessian of the springs plus that of the block without its geometric part [N/m]."""
        local = self._local(positions)
        tangent = self.frame.tangent(local, np.zeros_like(local))
        return self._pattern.sum(self.network.projected_hessian(positions), tangent)

    def stretch(self, positions: Floats) -> Floats:
        """Return length over rest length of the springs [-], shape (n_springs,)."""
        return self.network.stretch(positions)

    @cached_property
    def _edges(self) -> Ints:
        """Edges of the elements of the block, shape (n_edges, 2)."""
        pairs = self.mesh.elements[self.chosen][:, np.array(self.mesh.kind.edges)].reshape(-1, 2)
        return np.unique(np.sort(pairs, axis=1), axis=0)

    @property
    def cells(self) -> dict[str, Ints]:
        """Springs and edges of the elements of the block as lines, shape (n_springs + n_edges, 2)."""
        return {"line": np.concatenate([self.springs, self._edges])}

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return tension [N], stretch [-], stiffness [N/m] and strain energy [J] of each line, shape (n_lines,).

        Tension and stiffness of the edges of the block are zero. The energy of the block is divided among its edges:
        half the work of the block's forces at their nodes, which may be negative.
        """
        block, edges = self.frame.block, self._edges
        of_nodes = np.zeros(len(self.nodes))
        of_nodes[block.numbers] = self._node_energies(positions)
        of_nodes /= np.maximum(np.bincount(edges.ravel(), minlength=len(of_nodes)), 1)
        now, rest = (np.linalg.norm(at[edges[:, 1]] - at[edges[:, 0]], axis=1) for at in (positions, self.nodes))
        nothing = np.zeros(len(edges))
        of_block = {
            "tension": nothing,
            "stretch": now / rest,
            "stiffness": nothing,
            "strain_energy": of_nodes[edges].sum(axis=1),
        }
        springs = self.network.cell_fields(positions)
        return {name: np.concatenate([springs[name], values]) for name, values in of_block.items()}


class _Union:
    """The sparsity pattern of springs and block together."""

    def __init__(self, potential: BlockSprings) -> None:
        self.n_nodes, self.dim = potential.nodes.shape
        of_springs = potential.network.hessian(potential.nodes)
        rows = np.repeat(np.arange(self.n_nodes), np.diff(of_springs.indptr))
        block = potential.frame.block
        surface, inside = block.surface, block.inside
        parts = [
            self._keys(rows, of_springs.indices.astype(np.int64)),
            self._keys(surface[:, None], surface).ravel(),
            self._keys(surface[:, None], inside).ravel(),
            self._keys(inside[:, None], surface).ravel(),
            self._keys(inside, inside),
        ]
        keys = np.unique(np.concatenate(parts))
        self._places = [np.searchsorted(keys, part) for part in parts]
        self._columns = (keys % self.n_nodes).astype(np.int32)
        self._starts = np.searchsorted(keys, np.arange(self.n_nodes + 1) * self.n_nodes).astype(np.int32)

    def _keys(self, rows: Ints, columns: Ints) -> Ints:
        """Return a number for each pair of row and column."""
        return np.asarray(rows * self.n_nodes + columns)

    def sum(self, springs: SparseMatrix, block: Tangent) -> SparseMatrix:
        """Return the sum of the matrix of the springs and the tangent of the block [N/m]."""
        dim, size = self.dim, self.n_nodes * self.dim
        values = np.zeros((len(self._columns), dim, dim))
        within, across = block.surface.transpose(0, 2, 1, 3), block.inside.transpose(0, 2, 1, 3)
        added = [
            springs.data,
            within,
            across,
            across.transpose(1, 0, 3, 2),
            np.broadcast_to(block.alone * np.eye(dim), (across.shape[1], dim, dim)),
        ]
        for place, part in zip(self._places, added, strict=True):
            values[place] += part.reshape(-1, dim, dim)
        return sparse.bsr_array((values, self._columns, self._starts), shape=(size, size))
