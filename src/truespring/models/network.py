"""Networks of springs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints, ShortInts, frozen_floats, frozen_ints
from truespring.assembly import Pattern
from truespring.errors import ModelError, nearest
from truespring.mesh import Mesh, Remainder
from truespring.models.mechanism import check_mechanism
from truespring.models.model import Model
from truespring.models.pair_law import PairLaw
from truespring.models.pair_laws import PAIR_LAWS, STRAIGHT
from truespring.models.spring_data import SpringData
from truespring.potential import SparseMatrix
from truespring.problem import Problem

# Springs whose length differs from their rest length by at most this share of it have no tension, but for rounding.
_UNSTRESSED = 1e-12


@dataclass(frozen=True, eq=False)
class SpringNetwork(Model):
    """Nodes joined by springs.

    With stiffness k, length l, rest length L, and unit vector n from the first node to the second: energy
    1/2 k (l - L)^2, tension T = k (l - L) (Lembryk and Ciszkiewicz, equation 3), Hessian block
    T/l (I - n n^T) + dT/dl n n^T. Other laws of the tension are in PAIR_LAWS.

    Attributes:
        nodes: undeformed positions [m], shape (n_nodes, dim).
        springs: node numbers, shape (n_springs, 2).
        stiffness: stiffness of each spring [N/m], shape (n_springs,).
        rest_length: rest length of each spring [m], shape (n_springs,); empty, the default, for the undeformed lengths.
        law: force law, a key of PAIR_LAWS: "straight", the default, or "neo-hookean", tension
            k L (s - s^-(d+1)) / (d + 2) with s = l / L and the dimension d of the nodes.
        mass: mass of the nodes, for a motion [kg], shape (n_nodes,); empty, the default, for that of the problem.

    Example:
        >>> import truespring as ts
        >>> import numpy as np
        >>> nodes = np.array([(0.0, 0.0), (1.0, 0.25), (2.0, 0.0)])
        >>> truss = ts.SpringNetwork(nodes, np.array([(0, 1), (1, 2)]), stiffness=np.array([1.0, 1.0]))
        >>> problem = ts.Problem(
        ...     truss.mesh, supports=[ts.Fixed([0, 2]), ts.Fixed([1], fix=["x"])], loads=[ts.Force([1], (0.0, -0.002))]
        ... )
        >>> solution = ts.solve(problem, truss)
        >>> f"{solution.states[-1].displacement[1, 1]:.4f} m"
        '-0.0190 m'
    """

    nodes: Floats
    springs: Ints
    stiffness: Floats
    rest_length: Floats = field(default_factory=lambda: np.zeros(0))
    law: str = STRAIGHT
    mass: Floats = field(default_factory=lambda: np.zeros(0))

    kind = "springs"
    has_springs = True

    def __post_init__(self) -> None:
        try:
            set_field = object.__setattr__
            set_field(self, "nodes", frozen_floats(self.nodes, (None, None), "nodes"))
            set_field(self, "springs", frozen_ints(self.springs, (None, 2), "springs"))
            self._check_springs()
            n_springs = len(self.springs)
            set_field(self, "stiffness", frozen_floats(self.stiffness, (n_springs,), "stiffness"))
            rest_length = np.asarray(self.rest_length)
            rest = (
                rest_length
                if rest_length.size
                else np.linalg.norm(self.nodes[self.springs[:, 1]] - self.nodes[self.springs[:, 0]], axis=1)
            )
            set_field(self, "rest_length", frozen_floats(rest, (n_springs,), "rest_length"))
            n_masses = len(self.nodes) if np.size(self.mass) else 0
            set_field(self, "mass", frozen_floats(self.mass, (n_masses,), "mass"))
        except ValueError as error:
            raise ModelError(str(error)) from None
        if not (self.rest_length > 0).all():
            raise ModelError(f"rest_length of spring {int((self.rest_length <= 0).argmax())} is not positive")
        if not (self.mass > 0).all():
            raise ModelError(f"mass of node {int((self.mass <= 0).argmax())} is not positive")
        if self.law not in PAIR_LAWS:
            raise ModelError(
                f"law = '{self.law}' is unknown{nearest(self.law, PAIR_LAWS)}; allowed: {', '.join(PAIR_LAWS)}"
            )

    def _check_springs(self) -> None:
        """Raise ModelError if node numbers of springs are invalid."""
        if not len(self.springs):
            raise ModelError("a network must have springs")
        if self.springs.min() < 0 or self.springs.max() >= len(self.nodes):
            raise ModelError(
                f"springs have node numbers {self.springs.min()} to {self.springs.max()}, allowed are 0 to "
                f"{len(self.nodes) - 1}"
            )
        loops = self.springs[:, 0] == self.springs[:, 1]
        if loops.any():
            raise ModelError(f"spring {int(loops.argmax())} joins node {self.springs[loops][0, 0]} to itself")

    @property
    def label(self) -> str:
        """Name in figures and tables."""
        return "springs"

    def potential(self, problem: Problem) -> "SpringNetwork":
        """Return the network; raise ModelError if it is a mechanism, which only inertia holds."""
        if problem.dynamics is None:
            check_mechanism(self, problem.loading.held)
        return self

    def on_remainder(self, left: Remainder) -> "SpringNetwork":
        """Return the springs between nodes of one remaining element, which in a network are springs."""
        there = left.holds(self.springs)
        return replace(
            self,
            nodes=self.nodes[left.nodes],
            springs=left.numbers[self.springs[there]],
            stiffness=self.stiffness[there],
            rest_length=self.rest_length[there],
            mass=self.mass[left.nodes] if self.mass.size else self.mass,
        )

    @cached_property
    def mesh(self) -> Mesh:
        """The network as a mesh of lines, for a Problem."""
        return Mesh(self.nodes, self.springs, "line")

    def spring_data(self) -> SpringData:
        """Return the springs as arrays."""
        names = ("springs", "stiffness", "rest_length")
        law = {"force_law": self.law, "dimension": self.nodes.shape[1]}
        return SpringData(self, {name: getattr(self, name) for name in names} | law)

    @property
    def cells(self) -> dict[str, Ints]:
        """Springs as lines, shape (n_springs, 2)."""
        return {"line": self.springs}

    @property
    def pair_law(self) -> PairLaw:
        """The force law of the springs."""
        return PAIR_LAWS[self.law]

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return tension [N], stretch [-], undeformed stiffness [N/m] and strain energy [J], shape (n_springs,)."""
        known = (self.stiffness, self.rest_length, self.lengths(positions), self.nodes.shape[1])
        return {
            "tension": self.stress(positions),
            "stretch": self.stretch(positions),
            "stiffness": self.stiffness,
            "strain_energy": self.pair_law.energy(*known),
        }

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.springs, *self.nodes.shape)

    def _run(self, kernel: Callable[..., Any], positions: Floats, *arguments: Any) -> list[Any]:
        """Run a loop over all springs in parallel."""
        from truespring.kernels.threads import run, writable

        return run(kernel, len(self.springs), writable(positions), *arguments, self._pattern.zero)

    @property
    def _data(self) -> tuple[ShortInts, Floats, Floats]:
        """Arguments of loops: nodes, stiffness [N/m] and rest length [m] of the springs."""
        return self._pattern.elements, self.stiffness, self.rest_length

    def lengths(self, positions: Floats) -> Floats:
        """Return the length of each spring [m], shape (n_springs,)."""
        from truespring.kernels import springs

        length = np.empty(len(self.springs))
        self._run(springs.lengths, positions, self._pattern.elements, length)
        return length

    @property
    def semidefinite_at_rest(self) -> bool:
        """Whether no spring has a negative stiffness or a tension at rest: the Hessian is then a sum of k n n^T."""
        change = np.abs(self.lengths(self.nodes) - self.rest_length)
        return bool((self.stiffness >= 0).all() and (change <= _UNSTRESSED * self.rest_length).all())

    def measure(self, positions: Floats) -> tuple[Floats]:
        """Return the length of each spring [m], shape (n_springs,), the only measure of its dashpot."""
        return (self.lengths(positions),)

    def since(self, measures: Sequence[Floats], time: float) -> "tuple[SpringNetwork]":
        """Return dashpots beside the springs: springs of `time` [-] times their stiffness, relaxed at the lengths.

        A Kelvin-Voigt element is again a spring: no rigid motion is damped (Kelvin-Voigt; see motion.Damper).
        """
        _ = self._pattern
        (lengths,) = measures
        found = replace(self, stiffness=time * np.abs(self.stiffness), rest_length=lengths, law=STRAIGHT)
        vars(found)["_pattern"] = self._pattern
        return (found,)

    def stretch(self, positions: Floats) -> Floats:
        """Return length over rest length of each spring [-], shape (n_springs,)."""
        return self.lengths(positions) / self.rest_length

    def stress(self, positions: Floats) -> Floats:
        """Return the tension of each spring [N], shape (n_springs,)."""
        tension = np.empty(len(self.springs))
        self._run(self.pair_law.loops.tensions, positions, *self._data, tension)
        return tension

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return T + dT/dl n . (d_j - d_i), the tension extrapolated along `step` [m], in N, shape (n_springs,)."""
        from truespring.kernels.threads import writable

        tension = np.empty(len(self.springs))
        self._run(self.pair_law.loops.extrapolated, positions, writable(step), *self._data, tension)
        return tension

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        return float(sum(self._run(self.pair_law.loops.energy, positions, *self._data)))

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        from truespring.kernels import springs
        from truespring.kernels.threads import run, writable

        x, pattern = writable(positions), self._pattern
        pull, force = np.empty(len(self.springs)), np.empty(self.nodes.shape)
        self._run(self.pair_law.loops.pulls, x, *self._data, pull)
        rows = (pattern.elements, pattern.at_starts, pattern.at)
        run(springs.internal_forces, len(self.nodes), x, *rows, pull, force, pattern.zero)
        return force

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress` [N] gives the geometric part, by default that at `positions`."""
        return self._tangent(positions, self._axial(positions), self.stress(positions) if stress is None else stress)

    def _axial(self, positions: Floats) -> Floats:
        """Return the axial stiffness dT/dl of each spring [N/m], shape (n_springs,)."""
        stiffness = np.empty(len(self.springs))
        self._run(self.pair_law.loops.axial, positions, *self._data, stiffness)
        return stiffness

    def _tangent(self, positions: Floats, stiffness: Floats, tension: Floats) -> SparseMatrix:
        """Return the matrix of springs with a stiffness [N/m] and a tension [N], both of shape (n_springs,)."""
        from truespring.kernels import springs
        from truespring.kernels.threads import run, writable

        x, pattern, values = writable(positions), self._pattern, self._pattern.values()
        parts = np.empty(len(self.springs)), np.empty(len(self.springs))
        self._run(springs.stiffen, x, pattern.elements, stiffness, tension, *parts)
        rows = (pattern.elements, pattern.at_starts, pattern.at)
        alone = len(pattern.columns) == len(self.nodes) + 2 * len(self.springs)
        places = (pattern.starts, pattern.slots, alone)
        run(springs.hessian, len(self.nodes), x, *rows, *parts, *places, values, pattern.zero)
        return pattern.matrix(values)

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the sum of the Hessians of springs without negative eigenvalues [N/m].

        These are those of the geometric part of compressed springs.
        """
        tension = np.maximum(self.stress(positions), 0.0)
        return self._tangent(positions, np.maximum(self._axial(positions), 0.0), tension)
