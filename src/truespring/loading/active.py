"""Active tension along fibres, as of muscles: a load that follows the fibres as the body deforms."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from operator import add
from typing import Self

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.assembly import Pattern
from truespring.errors import ProblemError
from truespring.loading.body import Body
from truespring.loading.history import History
from truespring.loading.load import FollowingLoad, Mark
from truespring.loading.values import number
from truespring.loading.words import element_words
from truespring.mesh import Mesh, Selection, select_elements, square_stretch_forms
from truespring.potential import SparseMatrix


@dataclass(frozen=True)
class ActiveTension(FollowingLoad):
    """A `tension` [Pa] along each family of fibres of the material: force per undeformed area across the fibres.

    If it is negative, the fibres push, as of an actuator that extends.

    `on` is an element group, a Box that contains the centres of the elements, or element numbers; None for the whole
    body, whose elements without fibres carry none. The potential of an element is tension x volume x stretch, the
    stretch of the fibres that of the mean of I4 over the element.

    Example:
        >>> import truespring as ts
        >>> muscle = ts.Material(young=10e3, poisson=0.3, fibres=ts.Fibres(along=(1.0, 0.0)))
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     muscle,
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.ActiveTension(2e3)],
        ... )
        >>> solution = ts.solve(problem, ts.Springs("gaussian"))
        >>> end = ts.nearest_node(problem.mesh, (0.04, 0.0))
        >>> bool(solution.states[-1].displacement[end, 0] < 0)
        True
    """

    tension: float
    on: Selection | None = None
    over: History | None = field(default=None, kw_only=True)
    on_elements = True
    instead = "forces on both ends of the fibres, which are dead"

    def following(self, body: Body, held: Bools) -> "FibreTension":
        """Return the potential; raise ProblemError if an element has no fibres."""
        tension = number(self.tension, "tension", "Pa")
        elements = self._elements(body)
        return FibreTension(body, elements, tension)

    def _elements(self, body: Body) -> Ints:
        """Return the numbers of the elements with the tension, shape (n,)."""
        if body.fibres is None:
            raise ProblemError(
                "an active tension acts along the fibres of the material, which has none: give it fibres, such as "
                "fibres = { along = [1, 0, 0] }"
            )
        with_fibres = np.asarray(body.fibres.any(axis=(0, 2)))
        if self.on is None:
            return np.flatnonzero(with_fibres)
        elements = select_elements(body.mesh, self.on)
        without = elements[~with_fibres[elements]]
        if without.size:
            raise ProblemError(
                f"{without.size} of {len(elements)} elements on {element_words(self.on)} have no fibres for an active "
                f"tension, the first is element {without[0]}: give their material fibres, or select others"
            )
        return elements

    def nodes(self, mesh: Mesh) -> Ints:
        """Return the nodes of the elements."""
        return np.unique(mesh.elements if self.on is None else mesh.elements[select_elements(mesh, self.on)])

    def scaled(self, factor: float) -> Self:
        """Return the load multiplied by a factor."""
        return replace(self, tension=factor * self.tension)

    def mark(self, body: Body, held: Bools) -> Mark:
        """Return an arrow along the fibres of the first family, in the element nearest to the mean direction."""
        elements = self._elements(body)
        assert body.fibres is not None
        along = body.fibres[0, elements]
        mean = along.mean(axis=0)
        nodes = np.unique(body.mesh.elements[elements])
        return Mark(nodes, along[int((along @ mean).argmax())], "T", self.tension, "Pa")

    def words(self) -> str:
        """Return the tension and where it acts."""
        where = "the whole body" if self.on is None else element_words(self.on)
        return f"active tension {self.tension:g} Pa along the fibres of {where}"


@dataclass(frozen=True)
class _Cells:
    """Elements of one kind with an active tension along one family of fibres.

    Attributes:
        nodes: node numbers, shape (n, k).
        forms: see `square_stretch_forms`, times the thickness, shape (n, k, k).
        volumes: undeformed volumes [m^3], shape (n,).
        pattern: the assembly of their matrices.
    """

    nodes: Ints
    forms: Floats
    volumes: Floats
    pattern: Pattern

    def stretch(self, positions: Floats) -> tuple[Floats, Floats]:
        """Return the stretch of the fibres [-], shape (n,), and the forms times the positions, shape (n, k, dim)."""
        places = positions[self.nodes]
        pulled = self.forms @ places
        return np.sqrt(np.maximum((pulled * places).sum(axis=(1, 2)) / self.volumes, 0.0)), pulled


class FibreTension:
    """Potential of an active tension T: T V (sqrt(I4) - 1), summed over elements and families of fibres.

    I4 is the mean square stretch of the fibres of an element, a quadratic form of the positions of its nodes. Under
    uniform strain the nominal stress is T a along the fibres. A fibre without length has no force.
    """

    def __init__(self, body: Body, elements: Ints, tension: float) -> None:
        """Store the tension [Pa] of elements of a body, which all have fibres."""
        self.nodes, self._tension = body.nodes, tension
        self._cells = tuple(_cells(body, elements))

    def energy(self, positions: Floats) -> float:
        """Return minus the work [J] of the tension from the undeformed body to `positions`."""
        return float(
            sum(self._tension * (cells.volumes * (cells.stretch(positions)[0] - 1)).sum() for cells in self._cells)
        )

    def gradient(self, positions: Floats) -> Floats:
        """Return minus the nodal forces [N], shape (n_nodes, dim)."""
        found = np.zeros(self.nodes.shape)
        for cells in self._cells:
            stretch, pulled = cells.stretch(positions)
            force = self._tension * _over(stretch)[:, None, None] * pulled
            found += cells.pattern.vector(force.reshape(len(force), -1))
        return found

    def hessian(self, positions: Floats) -> SparseMatrix:
        """Return the derivative of the gradient [N/m], shape (n_nodes dim, n_nodes dim)."""
        found = [cells.pattern.summed(partial(self._matrices, positions, cells)) for cells in self._cells]
        return reduce(add, found)

    def _matrices(self, positions: Floats, cells: _Cells, first: int, last: int) -> Floats:
        """Return the matrices of a range of elements [N/m], shape (n, k dim, k dim)."""
        part = replace(
            cells,
            nodes=cells.nodes[first:last],
            forms=cells.forms[first:last],
            volumes=cells.volumes[first:last],
        )
        stretch, pulled = part.stretch(positions)
        inverse = self._tension * _over(stretch)
        slope = pulled.reshape(len(pulled), -1)
        crossed = (inverse * _over(stretch) ** 2 / part.volumes)[:, None, None] * (slope[:, :, None] * slope[:, None])
        dim = positions.shape[1]
        for axis in range(dim):
            crossed[:, axis::dim, axis::dim] -= inverse[:, None, None] * part.forms
        return np.asarray(-crossed)


def _over(stretch: Floats) -> Floats:
    """Return one over the stretch; zero for a fibre without length."""
    return np.divide(1.0, stretch, out=np.zeros_like(stretch), where=stretch > 0)


def _cells(body: Body, elements: Ints) -> Iterator[_Cells]:
    """Yield the elements of each kind and family of fibres."""
    assert body.fibres is not None
    for numbers, block in body.mesh.blocks:
        chosen = np.flatnonzero(np.isin(numbers, elements))
        nodes = body.whole(block.elements[chosen])
        vtk, k = block.kind.vtk, nodes.shape[1]
        for along in body.fibres[:, numbers[chosen]]:
            there = along.any(axis=1)
            if there.any():
                name = vtk if k == block.kind.n_nodes else f"{vtk}{k}"
                forms = body.thickness * square_stretch_forms(name, body.nodes, nodes[there], along[there])
                places = body.nodes[nodes[there]]
                volumes = ((forms @ places) * places).sum(axis=(1, 2))  # the undeformed stretch is 1
                yield _Cells(nodes[there], forms, volumes, Pattern(nodes[there], *body.nodes.shape))
