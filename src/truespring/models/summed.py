"""Potentials of elements of several kinds on the same nodes, as a sum over the kinds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints, ShortInts
from truespring.mesh import Mesh
from truespring.models.fem_potential import FemPotential
from truespring.models.law import Law
from truespring.models.linked import LinkedElements
from truespring.models.spring_data import COUPLING, SpringData
from truespring.potential import Projectable, SparseMatrix, Stressed, Stretched, VolumeStiffness, volumes_of
from truespring.problem import Problem


class SummablePart(Stressed, Projectable, Protocol):
    """A potential of elements of one kind."""

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return values on the cells in SI units, by name, each of shape (n_cells, ...)."""
        ...


class SummableSprings(SummablePart, Stretched, Protocol):
    """A potential of springs on elements of one kind."""


Part = TypeVar("Part", bound=SummablePart)
SpringPart = TypeVar("SpringPart", bound=SummableSprings)


class _Blocks(NamedTuple):
    """The blocks of a sum of BSR matrices, and the positions of the blocks of each part among them."""

    starts: ShortInts
    columns: ShortInts
    places: tuple[Ints, ...]


@dataclass(frozen=True, eq=False)
class Summed(Generic[Part]):
    """The sum of potentials on the nodes of one problem.

    Attributes:
        parts: a potential for each kind of element, in the order of `Problem.blocks`.
        problem: the whole problem.
    """

    parts: tuple[Part, ...]
    problem: Problem

    @property
    def mesh(self) -> Mesh:
        """The problem's mesh."""
        return self.problem.mesh

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim)."""
        return self.problem.mesh.nodes

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]; infinite if that of a part is."""
        return sum(part.energy(positions) for part in self.parts)

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        return np.asarray(sum(part.gradient(positions) for part in self.parts))

    def stress(self, positions: Floats) -> Floats:
        """Return the stresses of the parts, one after the other, shape (n,)."""
        return np.concatenate([part.stress(positions).ravel() for part in self.parts])

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stresses extrapolated linearly along `step` [m], as `stress`."""
        return np.concatenate([part.extrapolated_stress(positions, step).ravel() for part in self.parts])

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress`, as from `stress()`, gives the geometric part."""
        if stress is None:
            return self._sum([part.hessian(positions) for part in self.parts])
        by_part = np.split(stress, np.cumsum([np.prod(shape) for shape in self._stress_shapes])[:-1])
        pairs = zip(self.parts, by_part, self._stress_shapes, strict=True)
        return self._sum([part.hessian(positions, own.reshape(shape)) for part, own, shape in pairs])

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the sum of the projected Hessians of the parts, positive semidefinite [N/m]."""
        return self._sum([part.projected_hessian(positions) for part in self.parts])

    def volume_stiffness(self, positions: Floats) -> tuple[VolumeStiffness, ...]:
        """Return the stiffness against changes of volume of those parts that know it."""
        functions = map(volumes_of, self.parts)
        return tuple(cells for found in functions if found is not None for cells in found(positions))

    @cached_property
    def _stress_shapes(self) -> tuple[tuple[int, ...], ...]:
        return tuple(part.stress(self.nodes).shape for part in self.parts)

    def _sum(self, matrices: Sequence[SparseMatrix]) -> SparseMatrix:
        """Return the sum of the matrices of the parts."""
        blocks, dim = self._blocks(matrices), self.nodes.shape[1]
        values = np.zeros((len(blocks.columns), dim, dim))
        for matrix, places in zip(matrices, blocks.places, strict=True):
            values[places] += matrix.data  # each block occurs once in a matrix
        return sparse.bsr_array((values, blocks.columns, blocks.starts), shape=matrices[0].shape)

    def _blocks(self, matrices: Sequence[SparseMatrix]) -> _Blocks:
        """Return the blocks of the sum, computed once, since those of a part do not change."""
        if "_found" not in self.__dict__:
            n_nodes = len(self.nodes)
            rows = [np.repeat(np.arange(n_nodes), np.diff(one.indptr)) for one in matrices]
            keys = [row * n_nodes + one.indices for row, one in zip(rows, matrices, strict=True)]
            every = np.unique(np.concatenate(keys))
            starts = np.searchsorted(every, np.arange(n_nodes + 1) * n_nodes).astype(np.int32)
            places = tuple(np.asarray(np.searchsorted(every, own)) for own in keys)
            self.__dict__["_found"] = _Blocks(starts, (every % n_nodes).astype(np.int32), places)
        found: _Blocks = self.__dict__["_found"]
        return found

    def _by_part(self, values: Callable[[Part], dict[str, Floats]]) -> dict[str, Floats]:
        """Return values on the cells of all parts, part by part."""
        found = [values(part) for part in self.parts]
        return {name: np.concatenate([one[name] for one in found]) for name in found[0]}


def summed_links(problem: Problem, make: Callable[[Problem], LinkedElements]) -> "LinkedElements | SummedLinks":
    """Return the potential that `make` returns for a problem; for several kinds of elements, the sum over the kinds."""
    if len(problem.blocks) == 1:
        return make(problem)
    return SummedLinks(tuple(make(part) for _, part in problem.blocks), problem)


class SummedElements(Summed[FemPotential]):
    """Finite elements of several kinds, conforming at common facets."""

    @property
    def law(self) -> Law:
        """The law, the same for all parts."""
        return self.parts[0].law

    @property
    def interpolation(self) -> str:
        """The interpolation, one of ELEMENTS, the same for all parts; simplices have a uniform strain."""
        return self.parts[0].interpolation

    @property
    def cells(self) -> dict[str, Ints]:
        """The elements by VTK name of their kind, shape (n_elements, nodes)."""
        return self.problem.mesh.cells

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return the true stress [Pa], shape (n_elements, 9), and strain energy [J], shape (n_elements,), by kind."""
        return self._by_part(lambda part: part.cell_fields(positions))


class SummedSprings(Summed[SpringPart]):
    """Elements of several kinds with springs between their nodes."""

    @cached_property
    def _shared(self) -> tuple[Ints, Ints]:
        """Springs, each pair of nodes once, and the number of the spring of each line of the parts."""
        lines = np.sort(np.concatenate([part.springs for part in self.parts]), axis=1)
        springs, of = np.unique(lines, axis=0, return_inverse=True)
        return springs, of.ravel()

    @property
    def springs(self) -> Ints:
        """Node numbers of the springs, each pair once, shape (n_springs, 2)."""
        return self._shared[0]

    def _of_springs(self, lines: dict[str, Floats]) -> dict[str, Floats]:
        """Return fields of the springs, shape (n_springs, ...), from those of the lines of the parts.

        The stretch is that of each line, other fields are sums over the lines.
        """
        springs, of = self._shared
        found = {}
        for name, values in lines.items():
            found[name] = np.zeros((len(springs), *values.shape[1:]))
            if name == "stretch":
                found[name][of] = values
            else:
                np.add.at(found[name], of, values)
        return found

    def stretch(self, positions: Floats) -> Floats:
        """Return length over undeformed length of each part's springs [-], kind by kind, shape (n,)."""
        return np.concatenate([part.stretch(positions) for part in self.parts])


class SummedLinks(SummedSprings[Any]):
    """Elements of several kinds whose energy is a function of the squared lengths of links."""

    def spring_data(self) -> SpringData:
        """Return the springs and, for each kind of element, numbers, nodes, links and coupling [J/m^4], as arrays."""
        arrays: dict[str, Any] = {"springs": self.springs}
        for (numbers, block), part in zip(self.problem.mesh.blocks, self.parts, strict=True):
            own = part.spring_data().arrays
            arrays |= {f"elements_{block.element}": numbers, f"corners_{block.element}": block.elements}
            arrays |= {f"{name}_{block.element}": own[name] for name in ("links", "coupling")}
        return SpringData(None, arrays, COUPLING)

    @property
    def cells(self) -> dict[str, Ints]:
        """Links as lines, shape (n_springs, 2)."""
        return {"line": self.springs}

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return tension [N], stretch [-], undeformed stiffness [N/m] and strain energy [J], shape (n_springs,)."""
        return self._of_springs(self._by_part(lambda part: part.cell_fields(positions)))
