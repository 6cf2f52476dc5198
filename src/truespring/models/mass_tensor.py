"""The mass-tensor method: forces as polynomials of the displacements, with precomputed tensors."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np

from truespring.arrays import Floats, Ints, ShortInts
from truespring.assembly import Pattern
from truespring.errors import ModelError, nearest
from truespring.memory import slices
from truespring.models.biquadratic import BiquadraticSprings
from truespring.models.fem import Fem
from truespring.models.fem_potential import FemPotential, fem_of_one_kind
from truespring.models.finite_elements import fem_potential
from truespring.models.interpolation import locking_warnings
from truespring.models.laws import LAWS
from truespring.models.model import Model
from truespring.models.strain import voigt_pairs
from truespring.models.summed import SummedElements
from truespring.models.symmetric import identity
from truespring.potential import SparseMatrix
from truespring.problem import Problem

#: Allowed laws: those whose energy is a polynomial of the displacements.
TENSOR_LAWS = tuple(name for name, law in LAWS.items() if law.quadratic)
_SIMPLICES = ("triangle", "tetrahedron")
# Smallest number of simplices for which threads share the work.
_SMALLEST_PIECE = 256


@dataclass(frozen=True)
class MassTensor(Model):
    """The mass-tensor method (Cotin, Delingette, Ayache 1999; nonlinear: Picinbono, Delingette, Ayache 2003).

    Attributes:
        law: linear on any element; saint-venant-kirchhoff on triangles and tetrahedra.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> ts.solve(problem, ts.MassTensor("linear"))
        Solution(mass-tensor (linear), converged, 11 states up to load factor 1)
    """

    law: str = field()

    kind = "mass-tensor"

    def __post_init__(self) -> None:
        if self.law in LAWS and self.law not in TENSOR_LAWS:
            raise ModelError(
                f"law = '{self.law}': the mass-tensor method requires an energy that is a polynomial of the "
                f"displacements; allowed: {', '.join(TENSOR_LAWS)}; use this law with fem or heml"
            )
        if self.law not in TENSOR_LAWS:
            close = nearest(self.law, TENSOR_LAWS)
            raise ModelError(f"law = '{self.law}' is unknown{close}; allowed: {', '.join(TENSOR_LAWS)}")

    @property
    def label(self) -> str:
        """Name in figures and tables."""
        return f"mass-tensor ({LAWS[self.law].label})"

    @property
    def finite(self) -> bool:
        """Whether strains are finite; false for the linear law."""
        return LAWS[self.law].finite

    def second_order(self, problem: Problem) -> Fem:
        """Return finite elements of second order with the same law, the limit of this model on fine meshes."""
        return Fem(self.law)

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return warnings about elements that lock."""
        return locking_warnings(problem)

    def potential(self, problem: Problem) -> "LinearTensors | NonlinearTensors":
        """Return the potential; raise ModelError if the law does not support the elements of the mesh."""
        element = problem.mesh.element
        if self.law == "linear":
            return LinearTensors(fem_potential(problem, self.law))
        if element not in _SIMPLICES:
            raise ModelError(
                f"law = '{self.law}' requires {' or '.join(_SIMPLICES)} elements; the mesh has {problem.mesh.kinds} "
                "elements: use kind = 'heml', which is the same function on any element, law = 'linear', or a mesh of "
                f"{_SIMPLICES[problem.mesh.dim - 2]} elements"
            )
        return NonlinearTensors(fem_of_one_kind(problem, self.law))


@dataclass(frozen=True, eq=False)
class _Tensors:
    """Base of both laws: nodes, cells and fields, computed by the equal finite elements."""

    fem: FemPotential | SummedElements

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim)."""
        return self.fem.nodes

    @property
    def cells(self) -> dict[str, Ints]:
        """The elements by VTK name of their kind, shape (n_elements, nodes)."""
        return self.fem.cells

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return the true stress [Pa], shape (n_elements, 9), and strain energy [J], shape (n_elements,)."""
        return self.fem.cell_fields(positions)

    @property
    def _zero(self) -> tuple[float, ...]:
        return (0.0,) * self.fem.mesh.dim


class LinearTensors(_Tensors):
    """Linear elasticity: force sum T_ij (u_j - u_i) on node i, with a tensor T_ij for each two nodes of an element.

    T_ij = sum V (lam g_i g_j^T + mu g_j g_i^T + mu (g_i . g_j) I) over the simplices at an edge, g the gradients of the
    shape functions (Cotin, Delingette, Ayache 1999); for other elements the integral, with tensors on the diagonals,
    too. The tensor of a vertex is minus the sum of the tensors of its edges. A force is a sum over edges, without a
    loop over elements.
    """

    @cached_property
    def tensors(self) -> SparseMatrix:
        """The tensors of edges and, on the diagonal, of vertices [N/m]: the constant tangent stiffness."""
        return self.fem.hessian(self.nodes)

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        from truespring.kernels import tensors
        from truespring.kernels.threads import run

        known = self._known(positions)
        return float(sum(run(tensors.edge_energy, len(positions), *known, self._zero)))

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        from truespring.kernels import tensors
        from truespring.kernels.threads import run

        force, known = np.empty(positions.shape), self._known(positions)
        run(tensors.edge_forces, len(positions), *known, force, self._zero)
        return force

    def _known(self, positions: Floats) -> tuple[Floats, Floats, ShortInts, ShortInts, Floats]:
        """Return arguments of kernels: current and undeformed positions, and the tensors by rows."""
        from truespring.kernels.threads import writable

        matrix = self.tensors
        return writable(positions), writable(self.nodes), matrix.indptr, matrix.indices, matrix.data

    def hessian(self, positions: Floats) -> SparseMatrix:
        """Return the tangent stiffness [N/m], the same for all positions."""
        return self.tensors

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the tangent stiffness, which is positive semidefinite [N/m]."""
        return self.tensors


@dataclass(frozen=True, eq=False)
class NonlinearTensors(_Tensors):
    """St. Venant-Kirchhoff law on simplices: an energy of fourth order in the displacements.

    In a simplex the Green strain is linear in z, the displacements w_a of nodes relative to the first node and the
    products w_a . w_b: W = z . T z / 2. The blocks of T are the tensors of second, third and fourth order of Picinbono,
    Delingette, Ayache (2003), W = 1/2 sum w_a . K_ab w_b + sum (w_a . w_b) (C_abc . w_c) + sum D_abcd (w_a . w_b)
    (w_c . w_d). They sum the tensors over the elements at each vertex, edge and face. Here each element has separate
    tensors, since with absolute displacements u, differences of order u^3 are lost to rounding.

    The same function as biquadratic springs and HEML, which compute the tangent.
    """

    fem: FemPotential

    @cached_property
    def links(self) -> BiquadraticSprings:
        """The same potential as a function of the lengths of links."""
        return BiquadraticSprings(self.fem.problem)

    @cached_property
    def tensors(self) -> Floats:
        """T of each element, or one for all equal ones, in blocks [N/m], [N/m^2], [N/m^3], shape (n, size, size).
        Rows and columns: dim^2 displacements by node, then the products w_a . w_b with a <= b.
        """
        problem, dim = self.fem.problem, self.fem.mesh.dim
        alike = len(problem.materials) == 1 and problem.mesh.forms.single
        size = dim * dim + dim * (dim + 1) // 2
        found = np.empty((1 if alike else len(problem.mesh.elements), size, size))
        for part in slices(len(found), 8 * size * size):
            first, last, _ = part.indices(len(found))
            gradients, volumes = self.fem.quadrature(first, last)
            strain = _strain_of(gradients[:, 0, 1:])
            at_rest = np.broadcast_to(identity(np.empty((strain.shape[1], 1, 1))), (strain.shape[1], len(strain), 1))
            response = self.fem.law.respond(at_rest, self.fem.constants.part(first, last))
            elasticity = np.moveaxis(response.elasticity().dense(at_rest)[..., 0], -1, 0)
            twice = np.where(np.arange(strain.shape[1]) < dim, 1.0, 2.0)[:, None] * strain
            found[part] = volumes[:, :, None] * (twice.swapaxes(1, 2) @ elasticity @ twice)
        return found

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.fem.elements, *self.nodes.shape)

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        from truespring.kernels import tensors
        from truespring.kernels.threads import run

        energy = np.empty(len(self.fem.elements))
        run(tensors.energies, len(energy), *self._known(positions), energy, self._zero, smallest=_SMALLEST_PIECE)
        return float(energy.sum())

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        from truespring.kernels import tensors
        from truespring.kernels.threads import run

        force = np.empty((len(self.fem.elements), self.fem.elements.shape[1] * self._pattern.dim))
        run(tensors.forces, len(force), *self._known(positions), force, self._zero, smallest=_SMALLEST_PIECE)
        return self._pattern.vector(force)

    def _known(self, positions: Floats) -> tuple[Floats, Floats, ShortInts, Floats]:
        """Return arguments of kernels: current and undeformed positions, the elements and their tensors."""
        from truespring.kernels.threads import writable

        return writable(positions), writable(self.nodes), self._pattern.elements, self.tensors

    def stress(self, positions: Floats) -> Floats:
        """Return the stress of the links as `BiquadraticSprings.stress` [N/m], shape (n_elements, links)."""
        return self.links.stress(positions)

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return this stress extrapolated linearly along `step` [m], in N/m, shape (n_elements, links)."""
        return self.links.extrapolated_stress(positions, step)

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress` [N/m] gives the geometric part, by default the current one."""
        return self.links.hessian(positions, stress)

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the tangent without the geometric part of compressed links, positive semidefinite [N/m]."""
        return self.links.projected_hessian(positions)


def _strain_of(gradients: Floats) -> Floats:
    """Return the derivative of the Green strain with respect to z, axes (element, component, entry of z).

    E_ij = sum_a (w_ai g_aj + w_aj g_ai) / 2 + sum_ab w_a . w_b (g_ai g_bj + g_aj g_bi) / 4. `gradients` of the shape
    functions of all nodes but the first have axes (element, node, direction).
    """
    n, dim, _ = gradients.shape
    products = list(combinations_with_replacement(range(dim), 2))
    strain = np.zeros((n, len(products), dim * dim + len(products)))
    for component, (i, j) in enumerate(voigt_pairs(dim)):
        for a in range(dim):
            strain[:, component, a * dim + i] += gradients[:, a, j] / 2
            strain[:, component, a * dim + j] += gradients[:, a, i] / 2
        for place, (a, b) in enumerate(products, dim * dim):
            both = gradients[:, a, i] * gradients[:, b, j] + gradients[:, a, j] * gradients[:, b, i]
            strain[:, component, place] = both / (4 if a == b else 2)
    return strain
