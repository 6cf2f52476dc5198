"""The potential of nodes joined by linear springs."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from truespring.arrays import Floats, Ints, frozen_floats, frozen_ints
from truespring.errors import ModelError
from truespring.mesh import Mesh
from truespring.potential import Pattern, SparseMatrix


@dataclass(frozen=True, eq=False)
class SpringNetwork:
    """Nodes joined by linear springs: the spring force of Lembryk and Ciszkiewicz, equation 3.

    Attributes:
        nodes: reference positions [m], shape (n_nodes, dim).
        springs: node numbers, shape (n_springs, 2).
        stiffness: [N/m], shape (n_springs,).
        rest_length: [m], shape (n_springs,); empty, the default, takes the distances in the reference positions.

    With length l, rest length L, unit vector n from the first node to the second:
    energy 1/2 k (l - L)^2, tension k (l - L), Hessian block k [(1 - L/l) (I - n n^T) + n n^T].
    """

    nodes: Floats
    springs: Ints
    stiffness: Floats
    rest_length: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        try:
            set_field = object.__setattr__
            set_field(self, "nodes", frozen_floats(self.nodes, (None, None), "nodes"))
            set_field(self, "springs", frozen_ints(self.springs, (None, 2), "springs"))
            self._check_springs()
            n_springs = len(self.springs)
            set_field(self, "stiffness", frozen_floats(self.stiffness, (n_springs,), "stiffness"))
            given = np.asarray(self.rest_length)
            rest = given if given.size else self._lengths(self.nodes)[1]
            set_field(self, "rest_length", frozen_floats(rest, (n_springs,), "rest_length"))
        except ValueError as error:
            raise ModelError(str(error)) from None
        if not (self.rest_length > 0).all():
            raise ModelError(f"rest_length of spring {int((self.rest_length <= 0).argmax())} is not positive")

    def _check_springs(self) -> None:
        if not len(self.springs):
            raise ModelError("a network without springs carries nothing")
        if self.springs.min() < 0 or self.springs.max() >= len(self.nodes):
            raise ModelError(
                f"springs name nodes {self.springs.min()} to {self.springs.max()}, there are 0 to {len(self.nodes) - 1}"
            )
        loops = self.springs[:, 0] == self.springs[:, 1]
        if loops.any():
            raise ModelError(f"spring {int(loops.argmax())} joins node {self.springs[loops][0, 0]} to itself")

    @cached_property
    def mesh(self) -> Mesh:
        """The network as a mesh of lines: what a Problem of a plain network takes."""
        return Mesh(self.nodes, self.springs, "line")

    @property
    def cells(self) -> tuple[str, Ints]:
        """The springs as lines, shape (n_springs, 2)."""
        return "line", self.springs

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Tension [N], stretch [-], stiffness [N/m] and strain energy [J] of each spring."""
        tension = self.stress(positions)
        return {
            "tension": tension,
            "stretch": self.stretch(positions),
            "stiffness": self.stiffness,
            "strain_energy": tension * (self._lengths(positions)[1] - self.rest_length) / 2,
        }

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.springs, *self.nodes.shape)

    def _lengths(self, positions: Floats) -> tuple[Floats, Floats]:
        """Unit vectors, shape (n_springs, dim), and lengths [m]; the vector of a collapsed spring is zero."""
        across = positions[self.springs[:, 1]] - positions[self.springs[:, 0]]
        length = np.linalg.norm(across, axis=1)
        return across / np.where(length > 0, length, 1.0)[:, None], np.asarray(length)

    def stretch(self, positions: Floats) -> Floats:
        """Length over rest length, shape (n_springs,)."""
        return self._lengths(positions)[1] / self.rest_length

    def stress(self, positions: Floats) -> Floats:
        """Tension [N], shape (n_springs,)."""
        return self.stiffness * (self._lengths(positions)[1] - self.rest_length)

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]."""
        return float(0.5 * self.stiffness @ (self._lengths(positions)[1] - self.rest_length) ** 2)

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        direction, length = self._lengths(positions)
        pull = (self.stiffness * (length - self.rest_length))[:, None] * direction
        return self._pattern.vector(np.concatenate([-pull, pull], axis=1)).reshape(positions.shape)

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m]; `stress` are the tensions [N] of the geometric part, by default the true ones."""
        return self._tangent(positions, self.stiffness, self.stress(positions) if stress is None else stress)

    def _tangent(self, positions: Floats, stiffness: Floats, tension: Floats) -> SparseMatrix:
        direction, length = self._lengths(positions)
        along = direction[:, :, None] * direction[:, None, :]
        across = np.eye(positions.shape[1]) - along
        # A collapsed spring has no direction: its geometric part is left out rather than infinite.
        sideways = np.divide(tension, length, out=np.zeros_like(length), where=length > 0)
        block = stiffness[:, None, None] * along + sideways[:, None, None] * across
        return self._pattern.matrix(np.block([[block, -block], [-block, block]]))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Each spring's Hessian with its negative eigenvalues cut off: compression bears no geometric part [N/m]."""
        return self._tangent(positions, np.maximum(self.stiffness, 0.0), np.maximum(self.stress(positions), 0.0))
