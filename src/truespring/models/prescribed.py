"""Springs of prescribed stiffness, spring by spring: measured, or fitted to references."""

from dataclasses import dataclass, field, replace

import numpy as np

from truespring.arrays import Floats, Ints, frozen_floats, frozen_ints
from truespring.errors import ModelError
from truespring.mesh import Remainder
from truespring.models.mechanism import check_mechanism
from truespring.models.model import Model
from truespring.models.network import SpringNetwork
from truespring.models.pair_laws import STRAIGHT
from truespring.models.volume import VolumeTerm
from truespring.models.volume_springs import VolumeSprings
from truespring.problem import Problem


@dataclass(frozen=True, eq=False)
class PrescribedSprings(Model):
    """The springs of a mesh, each of a prescribed stiffness, and a modulus of the volume term of each element.

    They follow no rule and form no lattice: they have no effective moduli.

    Attributes:
        springs: node numbers, shape (n_springs, 2).
        stiffness: stiffness of each spring [N/m], shape (n_springs,).
        kappa: modulus of the area or volume term of each element [Pa], shape (n_elements,); empty for none.
        label: name in figures and tables.
        law: force law, a key of PAIR_LAWS.

    Raises ModelError if shapes do not match, or if a node number is not in the mesh of the problem.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> import numpy as np
        >>> edges = problem.mesh.edges
        >>> braces = problem.mesh.elements[:, [0, 2]]
        >>> springs = ts.PrescribedSprings(np.concatenate([edges, braces]), np.full(len(edges) + len(braces), 40.0))
        >>> ts.solve(problem, springs)
        Solution(springs (prescribed), converged, 11 states up to load factor 1)
    """

    springs: Ints
    stiffness: Floats
    kappa: Floats = field(default_factory=lambda: np.zeros(0))
    label: str = "springs (prescribed)"
    law: str = STRAIGHT

    kind = "springs"
    has_springs = True

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "springs", frozen_ints(self.springs, (None, 2), "springs"))
            object.__setattr__(self, "stiffness", frozen_floats(self.stiffness, (len(self.springs),), "stiffness"))
            object.__setattr__(self, "kappa", frozen_floats(self.kappa, (None,), "kappa"))
        except ValueError as error:
            raise ModelError(str(error)) from None

    def __repr__(self) -> str:
        volume = ", with a volume term" if self.kappa.size else ""
        return f"PrescribedSprings({self.label}, {len(self.springs)} springs{volume})"

    def on_remainder(self, left: Remainder) -> "PrescribedSprings":
        """Return the springs between nodes of one remaining element, and the modulus of each of these elements."""
        there = left.holds(self.springs)
        springs, kappa = left.numbers[self.springs[there]], self.kappa[left.elements] if self.kappa.size else self.kappa
        return replace(self, springs=springs, stiffness=self.stiffness[there], kappa=kappa)

    def potential(self, problem: Problem) -> SpringNetwork | VolumeSprings:
        """Return the potential on the mesh of a problem; raise ModelError if the network is a mechanism."""
        network = SpringNetwork(problem.mesh.nodes, self.springs, self.stiffness, law=self.law)
        if not (self.stiffness > 0).any():
            raise ModelError("stiffness: at least one spring must have a positive stiffness")
        if not self.kappa.size:
            check_mechanism(network, problem.loading.held)
            return network
        if len(self.kappa) != len(problem.mesh.elements):
            raise ModelError(f"kappa has {len(self.kappa)} values, the mesh has {len(problem.mesh.elements)} elements")
        return VolumeSprings(network, VolumeTerm(problem, self.kappa))
