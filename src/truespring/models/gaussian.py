"""Gaussian springs: springs of zero rest length between the nodes of an element, and a pressure in each element."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints, ShortInts
from truespring.assembly import Pattern
from truespring.fibres import Families
from truespring.mesh.rows import distinct_rows
from truespring.models.cell_fields import CHANGE_OF_TENSION, beside, lengths, stretch
from truespring.models.element_volumes import ElementVolumes
from truespring.models.fibres import fibre_energy
from truespring.models.gaussian_weights import ROUNDING, Laplacians
from truespring.models.invariants import Condensed, condensed
from truespring.models.law import Constants, Law
from truespring.models.laws import LAWS
from truespring.models.semidefinite import clipped, is_semidefinite
from truespring.models.spring_data import PRESSURE, SpringData
from truespring.models.summed import SummedSprings
from truespring.potential import ConstantCells, SparseMatrix, VolumeStiffness
from truespring.problem import Problem

# Smallest number of elements, or of nodes, for which threads share the work.
_SMALLEST_PIECE = 64
# Largest number of different elements whose eigenvalues at rest are computed: beyond it Lanczos may be faster.
_FEW = 64


class _State(NamedTuple):
    """The elements in a deformed state.

    Attributes:
        sums: quadratic forms [m^3], shape (n_forms, n_elements).
        ratio: volume over undeformed volume [-], shape (n_elements,).
        law: energy density and derivatives.
        fibres: energy density of each family of fibres and its first and second derivative [Pa], shape (n_families,
            n_elements) each.
    """

    sums: Floats
    ratio: Floats
    law: Condensed
    fibres: tuple[Floats, Floats, Floats]


class _Recent(NamedTuple):
    """A state that was asked for: a step of a solver asks several times for that before and after it.

    Attributes:
        positions: [m], shape (n_nodes, dim).
        energy: whether quadratic forms and energy density are defined.
        state: the elements.
    """

    positions: Floats
    energy: bool
    state: _State


class _Curvature(NamedTuple):
    """Arguments of the kernels that add second derivatives; shapes as in `kernels.gaussian.rows`."""

    x: Floats
    elements: ShortInts
    starts: ShortInts
    others: ShortInts
    coefficients: Floats
    slope: Floats
    second: Floats
    pressure: Floats
    matrices: Floats
    of: Ints
    factors: Floats

    @property
    def without_forms(self) -> "_Curvature":
        """The same without the stiffness of the forms."""
        return self._replace(matrices=self.matrices[:0], factors=self.factors[:0])


@dataclass(frozen=True, eq=False)
class GaussianElements:
    """The potential of Gaussian springs on elements of one kind.

    With F the deformation gradient of the shape functions, the mean of tr F^T F over an element is a quadratic form of
    the positions of its nodes, Q / V0 with Q = sum of w |x_a - x_b|^2 and w_ab = - integral of grad N_a . grad N_b:
    springs of zero rest length. The energy is V0 W(I1, ln J) of that mean and of the ratio J = V / V0. The neo-Hookean
    law is linear in I1, so that the springs have the constant stiffness mu w; other laws change the stiffness of all
    springs of an element together. The square of a fibre's stretch is a quadratic form, too.

    Sources: James and Guth 1943 (Gaussian chains and a pressure); Pinkall and Polthier 1993 (w on triangles).

    Attributes:
        problem: mesh, material and section.
        law: the constitutive law, with `invariants`.
        constants: its constants.
        laplacians: the matrices of the quadratic form of each element; those of fibres follow that of tr C.
        fibres: the fibres; None without.
    """

    problem: Problem
    law: Law
    constants: Constants
    laplacians: Laplacians
    fibres: Families | None = None

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim)."""
        return self.problem.mesh.nodes

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.problem.mesh.elements, *self.nodes.shape)

    @cached_property
    def _volumes(self) -> Floats:
        """Undeformed volume of each element [m^3], area times thickness in 2D, shape (n_elements,)."""
        return self._measures.at(self.nodes)[1]

    @cached_property
    def _measures(self) -> ElementVolumes:
        n_forms = 0 if self.constant else len(self.laplacians.matrices)
        return ElementVolumes(self.problem, self._pattern.elements, n_forms + 1)

    @property
    def _forms(self) -> tuple[Floats, Ints]:
        """Arguments of kernels: matrices of the quadratic forms and the class of each element."""
        return self.laplacians.matrices, self.laplacians.of

    def _run(self, kernel: Any, *arguments: Any) -> None:
        """Run a kernel on all elements in parallel."""
        from truespring.kernels.threads import run

        run(kernel, len(self._pattern.elements), *arguments, self._pattern.zero, smallest=_SMALLEST_PIECE)

    def _state(self, positions: Floats, energy: bool = True) -> _State:
        """Return the elements in a deformed state; NaN in inverted elements. The last two are kept.

        Without `energy`, the quadratic forms and the energy density are undefined where the derivatives do not depend
        on them.
        """
        recent: tuple[_Recent, ...] = self.__dict__.get("_recent", ())
        for one in recent:
            if (one.energy or not energy) and np.array_equal(one.positions, positions):
                return one.state
        state = self._new_state(positions, energy)
        self.__dict__["_recent"] = (_Recent(positions.copy(), energy, state), *recent[:1])
        return state

    def _new_state(self, positions: Floats, energy: bool) -> _State:
        """Return the elements in a deformed state, see `_state`."""
        from truespring.kernels import gaussian
        from truespring.kernels.threads import writable

        sums = np.zeros((len(self.laplacians.matrices), len(self._pattern.elements)))
        if energy or not self.constant:
            self._run(gaussian.sums, writable(positions), self._pattern.elements, *self._forms, sums)
        ratio = self._measures.at(positions)[1] / self._volumes
        ratio = np.where(ratio > 0, ratio, np.nan)
        squares = sums / self._volumes
        law = self._respond(squares[0], np.log(ratio))
        return _State(sums, ratio, law, self._stretched(squares[1:]))

    def _respond(self, trace: Floats, y: Floats) -> Condensed:
        """Return the law at the mean trace of C and ln J of each element, shape (n_elements,)."""
        invariants = self.law.invariants
        assert invariants is not None  # see Springs
        with np.errstate(over="ignore", invalid="ignore"):
            return condensed(invariants, trace, y, self.nodes.shape[1], self._by_element).filled

    @cached_property
    def _by_element(self) -> Constants:
        """The constants, arrays of shape (n_elements,) for several materials."""
        return self.constants.raveled

    def _stretched(self, squares: Floats) -> tuple[Floats, Floats, Floats]:
        """Return energy density and derivatives of fibres whose stretch has the given square."""
        return (squares,) * 3 if self.fibres is None else fibre_energy(squares, self.fibres.k1, self.fibres.k2)

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]; infinite if an element is inverted."""
        state = self._state(positions)
        density = state.law.at.energy + state.fibres[0].sum(axis=0)
        total = float((density * self._volumes).sum())
        return total if np.isfinite(total) else float("inf")

    def stress(self, positions: Floats) -> Floats:
        """Return the derivatives of the energy density by I1, by fibres and by ln J [Pa], shape (n, n_elements).

        The last is the Kirchhoff pressure J dW/dJ: extrapolated along a step, it keeps the iteration stable at large
        rotations, which the pressure dW/dJ does not.
        """
        return self._stress(self._state(positions, energy=False))

    @staticmethod
    def _stress(state: _State) -> Floats:
        return np.concatenate([state.law.at.by_trace[None], state.fibres[1], state.law.at.by_y[None]])

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress extrapolated linearly along `step` [m], in Pa, shape (n, n_elements)."""
        from truespring.kernels import gaussian
        from truespring.kernels.threads import writable

        state, slope = self._state(positions, energy=False), self._slopes(positions)
        stress, second = self._stress(state), self._second(state)
        growth = np.empty((self._measures.rows, len(self._volumes)))
        self._run(gaussian.growths, writable(step), self._pattern.elements, slope, growth)
        growth /= self._volumes
        growth[-1] /= state.ratio
        if self.constant:
            stress[-1] += second[:, -1, -1] * growth[-1]
            return stress
        return np.asarray(stress + np.einsum("emn,ne->me", second, growth))

    @staticmethod
    def _second(state: _State) -> Floats:
        """Return second derivatives of the energy density by I1, fibres and ln J [Pa], shape (n_elements, n, n)."""
        at, curvature = state.law.at, state.fibres[2]
        n = len(curvature) + 2
        second = np.zeros((len(state.ratio), n, n))
        second[:, 0, 0], second[:, -1, -1] = at.by_trace_trace, at.by_y_y
        second[:, 0, -1] = second[:, -1, 0] = at.by_trace_y
        for family, values in enumerate(curvature, start=1):
            second[:, family, family] = values
        return second

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        from truespring.kernels import gaussian
        from truespring.kernels.threads import run, writable

        x, pattern, state = writable(positions), self._pattern, self._state(positions, energy=False)
        factors, force = self._stress(state)[-self._measures.rows :], np.zeros(self.nodes.shape)
        factors[-1] /= state.ratio
        if self._weights is not None:
            known = (x, pattern.starts, pattern.columns, self._weights)
            run(gaussian.pulls, len(force), *known, force, pattern.zero, smallest=_SMALLEST_PIECE)
        known = (pattern.at_starts, pattern.at, self._slopes(positions), factors)
        run(gaussian.add_forces, len(force), *known, force, pattern.zero, smallest=_SMALLEST_PIECE)
        return force

    @cached_property
    def _weights(self) -> Floats | None:
        """The stiffness between each node and its neighbours [N/m], shape (n_blocks,), if it is constant, else None."""
        if not self.constant:
            return None
        return self._scattered(-self._at_rest.law.at.by_trace)

    @property
    def constant(self) -> bool:
        """Whether the springs have a constant stiffness: the law is linear in I1, and there are no fibres."""
        return self.law.constant_springs and len(self.laplacians.matrices) == 1

    @property
    def constant_springs(self) -> tuple[ConstantCells, ...] | None:
        """The elements for compiled loops, see Explicit; None unless the springs are constant."""
        constants, invariants = self._by_element, self.law.invariants
        if not self.constant or invariants is None:
            return None
        zero, n = np.zeros(len(self._volumes)), len(self._volumes)
        at = invariants(zero + 3, zero, constants)  # undeformed, without the condition of plane stress
        shear, offset, slope = (
            np.broadcast_to(one, n).astype(np.float64) for one in (2 * at.by_trace, at.by_y, at.by_y_y)
        )
        matrices, of = self._forms
        law = (shear, self._volumes, shear if constants.plane_stress else zero, offset, slope)
        return (ConstantCells(self._pattern.elements, matrices[0], of, *law, *self._measures.form),)

    @cached_property
    def _at_rest(self) -> _State:
        return self._state(self.nodes)

    def _scattered(self, factors: Floats) -> Floats:
        """Return twice the sum of `factors` [Pa] times the matrices of I1, shape (n_blocks,), for pairs of nodes."""
        matrices, of = self._forms
        values = (2 * factors)[:, None, None] * matrices[0][of]
        found = np.bincount(self._pattern.slots.ravel(), values.ravel(), len(self._pattern.columns))
        return found.astype(np.float64, copy=False)

    def _slopes(self, positions: Floats) -> Floats:
        """Return the derivatives of forms that are not constant, and of the volume, of each element; see Measured."""
        from truespring.kernels import gaussian
        from truespring.kernels.threads import writable

        slope = self._measures.at(positions)[0]
        if not self.constant:
            self._run(gaussian.slopes, writable(positions), self._pattern.elements, *self._forms, slope)
        return slope

    def _curvature(self, positions: Floats, stress: Floats | None) -> _Curvature:
        """Return what second derivatives are added from, with the forms; `stress` as from `stress()`, or that here."""
        from truespring.kernels.threads import writable

        state = self._state(positions, energy=False)
        stress = self._stress(state) if stress is None else stress
        second = self._second(state)[:, -self._measures.rows :, -self._measures.rows :]
        second[:, -1, -1] -= stress[-1]
        second /= self._volumes[:, None, None]
        second[:, -1] /= state.ratio[:, None]  # by the volume instead of ln J
        second[:, :, -1] /= state.ratio[:, None]
        at = (writable(positions), self._pattern.elements, *self._measures.turns, self._slopes(positions))
        factors = np.ascontiguousarray(stress[:-1])
        return _Curvature(*at, np.ascontiguousarray(second), stress[-1] / state.ratio, *self._forms, factors)

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress`, as from `stress()`, gives the geometric part."""
        return self._assembled(self._curvature(positions, stress))

    def _assembled(self, known: _Curvature) -> SparseMatrix:
        """Return the sum of the elements' second derivatives [N/m]."""
        from truespring.kernels import gaussian
        from truespring.kernels.threads import run

        pattern, values = self._pattern, self._pattern.values()
        weights = np.empty(0) if self._weights is None else self._weights
        known = known.without_forms if self.constant else known  # which `weights` contain
        rows = (pattern.at_starts, pattern.at, pattern.slots, pattern.starts, weights)
        run(gaussian.rows, len(self.nodes), *rows, *known, values, pattern.zero, smallest=_SMALLEST_PIECE)
        return pattern.matrix(values)

    def volume_stiffness(self, positions: Floats) -> tuple[VolumeStiffness, ...]:
        """Return d2W / d(ln J)^2 and twice dW/dI1, the shear modulus, as stiffness of the volume of each element."""
        at, rows = self._state(positions, energy=False).law.at, self._measures.rows
        slope, volume = self._measures.at(positions)
        share = self._volumes / volume**2
        return (
            VolumeStiffness(
                self._pattern.elements, slope[rows - 1 :: rows], at.by_y_y * share, 2 * at.by_trace * share
            ),
        )

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the tangent stiffness with as much of the pressure as leaves each element semidefinite [N/m].

        The stiffness of an element consists of that of its springs, that against changes of the forms and the volume,
        and the pressure times the second derivative of the volume, which is indefinite. The pressure, and what the
        second part has of negative eigenvalues, are multiplied by the largest of the shares 0, 1/16, ..., 1 for which
        the element has no negative eigenvalue.
        """
        from truespring.kernels import gaussian

        known = self._curvature(positions, None)
        positive, share = clipped(known.second), np.empty(len(self._volumes))
        negative = known.second - positive
        known = known._replace(second=positive, factors=np.maximum(known.factors, 0.0))
        self._run(gaussian.shares, *known, negative, gaussian.LANES, share)
        second = positive + share[:, None, None] * negative
        return self._assembled(known._replace(second=second, pressure=share * known.pressure))

    @cached_property
    def semidefinite_at_rest(self) -> bool:
        """Whether few elements differ, and none has a negative eigenvalue at rest; see Unstressed."""
        first = distinct_rows((self.laplacians.of, self.problem.material_numbers)).first
        return len(first) <= _FEW and is_semidefinite(self._matrices(self._curvature(self.nodes, None), first))

    def element_hessians(self, positions: Floats) -> Floats:
        """Return the tangent stiffness of each element [N/m], shape (n_elements, n_dof, n_dof), node by node."""
        return self._matrices(self._curvature(positions, None), slice(None))

    def _matrices(self, known: _Curvature, here: slice | Ints) -> Floats:
        """Return the tangent stiffness of the elements `here` [N/m]."""
        from truespring.kernels import gaussian
        from truespring.kernels.threads import run

        slope = known.slope.reshape(-1, self._measures.rows, *known.slope.shape[1:])[here]
        own = known._replace(
            elements=known.elements[here],
            slope=slope.reshape(-1, *known.slope.shape[1:]),
            second=known.second[here],
            pressure=known.pressure[here],
            of=known.of[here],
            factors=np.ascontiguousarray(known.factors[:, here]),
        )
        n_dof = own.elements.shape[1] * self._pattern.dim
        blocks = np.zeros((len(own.elements), n_dof, n_dof))
        run(gaussian.add_matrices, len(blocks), *own, blocks, self._pattern.zero, smallest=_SMALLEST_PIECE)
        return blocks

    def element_arrays(self) -> dict[str, Any]:
        """Return the elements as arrays: undeformed volumes, constants of the law, simplices of an element.

        If the law does not have springs of constant stiffness, also the weight of each link, and if there are fibres
        those of each family; see docs/export/arrays.md.
        """
        constants, kind, n = self._by_element, self.problem.mesh.kind, len(self._volumes)
        values = {"lam": constants.lam, "mu": constants.mu, **constants.values}
        found = {"volume": self._volumes, **{name: np.broadcast_to(value, n) for name, value in values.items()}}
        found |= {"simplices": np.array(kind.simplices), "simplex_weight": np.array(kind.simplex_weight)}
        if self.constant:
            return found
        found |= {"links": np.array(kind.links)}
        weights = self._link_weights()
        if not self.law.constant_springs:
            found |= {"link_weights": weights[0]}
        if self.fibres is not None:
            found |= {"fibre_weights": weights[1:], "k1": self.fibres.k1, "k2": self.fibres.k2}
        return found

    @cached_property
    def _shared(self) -> tuple[Ints, Ints, Ints]:
        """Springs, each pair of nodes once, the number of the spring of each link, and the links of nonzero weight."""
        from truespring.kernels.sparsity import unique_pairs
        from truespring.kernels.threads import writable

        mesh = self.problem.mesh
        weights = np.abs(self._link_weights()).max(axis=0)
        present = np.flatnonzero(weights.ravel() > ROUNDING * weights.max())
        pairs = mesh.elements[:, np.array(mesh.kind.links)].reshape(-1, 2)[present]
        return (*unique_pairs(writable(pairs), mesh.n_nodes), present)

    def _link_weights(self) -> Floats:
        """Return the weight of each link in each quadratic form [m], shape (n_forms, n_elements, links)."""
        links = np.array(self.problem.mesh.kind.links)
        return np.asarray(-self.laplacians.matrices[:, :, links[:, 0], links[:, 1]][:, self.laplacians.of])

    @property
    def springs(self) -> Ints:
        """Node numbers of the springs, each pair once, shape (n_springs, 2)."""
        return self._shared[0]

    def _summed(self, values: Floats) -> Floats:
        """Return the sum over elements of values of links, shape (n_elements, links), for springs, (n_springs,)."""
        springs, place, present = self._shared
        return np.bincount(place, values.ravel()[present], len(springs)).astype(np.float64, copy=False)

    @property
    def stiffness(self) -> Floats:
        """Stiffness of the undeformed springs [N/m], shape (n_springs,); negative across obtuse angles of simplices."""
        return self._stiffness(self._at_rest)

    def _stiffness(self, state: _State) -> Floats:
        factors = self._stress(state)[:-1]
        return self._summed(2 * np.einsum("fe,fel->el", factors, self._link_weights()))

    def stretch(self, positions: Floats) -> Floats:
        """Return length over undeformed length of each spring [-], shape (n_springs,)."""
        return stretch(self.springs, self.nodes, positions)

    def spring_data(self) -> SpringData:
        """Return springs, elements and constants of the volume function as arrays; see docs/export/arrays.md."""
        return gaussian_data((self,), self.problem, self.springs, self.stiffness)

    @property
    def cells(self) -> dict[str, Ints]:
        """Springs as lines, shape (n_springs, 2), and the elements, shape (n_elements, nodes)."""
        return {"line": self.springs, **self.problem.mesh.cells}

    cell_note = CHANGE_OF_TENSION

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return fields of springs, then of elements, NaN where a field is not defined, shape (n_cells, ...).

        Springs: change of tension from the undeformed body [N], stretch [-] and stiffness [N/m]. Elements: true stress
        [Pa], shape (n_cells, 9), and strain energy [J].
        """
        state, springs = self._state(positions), self.springs
        stiffness = self._stiffness(state)
        change = stiffness * lengths(springs, positions) - self.stiffness * lengths(springs, self.nodes)
        lines = {"tension_change": change, "stretch": self.stretch(positions), "stiffness": stiffness}
        energy = self._volumes * (state.law.at.energy + state.fibres[0].sum(axis=0))
        return beside(lines, {"stress": self.cauchy_stress(positions).reshape(-1, 9), "strain_energy": energy})

    def cauchy_stress(self, positions: Floats) -> Floats:
        """Return the true stress of the mean deformation of each element [Pa], shape (n_elements, 3, 3).

        (2 W_I1 <F F^T> + W_lnJ I) / J, <F F^T> the mean over the element, and the stress of the third direction.
        """
        state, dim = self._state(positions), self.nodes.shape[1]
        at, C_33 = state.law.at, state.law.C_33
        stress = np.zeros((len(state.ratio), 3, 3))
        for form, factor in enumerate(self._stress(state)[:-1]):
            matrices = self.laplacians.matrices[form][self.laplacians.of]
            places = positions[self._pattern.elements]
            mean = np.einsum("eai,eab,ebj->eij", places, matrices, places) / self._volumes[:, None, None]
            stress[:, :dim, :dim] += 2 * factor[:, None, None] * mean
        stress[:, range(dim), range(dim)] += at.by_y[:, None]
        if dim == 2:
            stress[:, 2, 2] = state.law.across
        return np.asarray(stress / (state.ratio * np.sqrt(C_33))[:, None, None])


class SummedGaussian(SummedSprings[GaussianElements]):
    """Gaussian springs on elements of several kinds."""

    cell_note = CHANGE_OF_TENSION

    @property
    def constant_springs(self) -> tuple[ConstantCells, ...] | None:
        """The elements of all kinds for compiled loops, see Explicit; None unless all springs are constant."""
        found = [part.constant_springs for part in self.parts]
        return None if None in found else tuple(cells for one in found if one is not None for cells in one)

    @property
    def semidefinite_at_rest(self) -> bool:
        """Whether no undeformed element has a negative eigenvalue, as far as is known; see Unstressed."""
        return all(part.semidefinite_at_rest for part in self.parts)

    @property
    def stiffness(self) -> Floats:
        """Stiffness of the undeformed springs [N/m], shape (n_springs,)."""
        own = np.concatenate([part.stiffness for part in self.parts])
        return np.bincount(self._shared[1], own, len(self.springs)).astype(np.float64, copy=False)

    def spring_data(self) -> SpringData:
        """Return springs, elements and constants of the volume function as arrays; see docs/export/arrays.md."""
        return gaussian_data(self.parts, self.problem, self.springs, self.stiffness)

    @property
    def cells(self) -> dict[str, Ints]:
        """Springs as lines, shape (n_springs, 2), and the elements by kind, shape (n, nodes)."""
        return {"line": self.springs, **self.problem.mesh.cells}

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return fields of springs, then of elements, as GaussianElements does; sums over the parts of springs."""
        parts = [(part.cell_fields(positions), len(part.springs)) for part in self.parts]
        names = parts[0][0]
        lines = {name: np.concatenate([fields[name][:n] for fields, n in parts]) for name in names}
        elements = {name: np.concatenate([fields[name][n:] for fields, n in parts]) for name in names}
        return {name: np.concatenate([own, elements[name]]) for name, own in self._of_springs(lines).items()}


def gaussian_data(
    parts: tuple[GaussianElements, ...], problem: Problem, springs: Ints, stiffness: Floats
) -> SpringData:
    """Return Gaussian springs as arrays: springs, and for each kind of element nodes, volumes and constants.

    Shapes: springs (n_springs, 2), stiffness (n_springs,) [N/m].
    """
    arrays: dict[str, Any] = {"springs": springs, "stiffness": stiffness, "rest_length": np.zeros(len(springs))}
    arrays["law"] = next(name for name, law in LAWS.items() if law is parts[0].law)
    for (numbers, block), part in zip(problem.mesh.blocks, parts, strict=True):
        suffix = f"_{block.element}" if len(parts) > 1 else ""
        arrays |= {f"{name}{suffix}": values for name, values in part.element_arrays().items()}
        if suffix:
            arrays |= {f"elements{suffix}": numbers, f"corners{suffix}": block.elements}
    return SpringData(None, arrays, PRESSURE)
