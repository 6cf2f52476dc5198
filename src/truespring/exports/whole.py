"""All nodes of an exported body: those of the mesh and, of elements of second order, those on their edges."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.conditions import Refined
from truespring.exports.exported import Exported
from truespring.mesh import element_corner_measures
from truespring.potential import Potential


@dataclass(frozen=True, eq=False)
class Whole:
    """The nodes that a simulation moves; arrays have shape (n, dim), the nodes of the mesh come first.

    Attributes:
        exported: the study with its equilibrium.
        nodes: undeformed positions [m].
        held: true where the displacement is prescribed.
        motion: prescribed displacement at full load [m], zero where free.
        force: nodal forces at full load [N].
        positions: the equilibrium at full load [m], None if it was not reached.
        second_order: nodes of elements of second order, shape (n_elements, k); None if nodes are those of the mesh.
    """

    exported: Exported
    nodes: Floats
    held: Bools
    motion: Floats
    force: Floats
    positions: Floats | None
    second_order: Ints | None = None

    @property
    def potential(self) -> Potential:
        """The energy of the springs as a function of the positions of all nodes."""
        potential = self.exported.path.potential
        assert potential is not None  # exports have springs
        return potential

    @property
    def springs(self) -> Ints:
        """The nodes of each spring, shape (n_springs, 2)."""
        return np.asarray(self.exported.springs.arrays["springs"])

    def lumped_mass(self, density: Floats) -> Floats:
        """Return the mass of each node for the density of each element [kg], shape (n,).

        The nodes of an element of second order have equal shares of its mass, so that none is negative.
        """
        problem, elements = self.exported.problem, self.second_order
        if elements is None:
            elements, shares = problem.mesh.elements, element_corner_measures(problem.mesh)
        else:
            k = elements.shape[1]
            shares = np.repeat(problem.mesh.measures[:, None] / k, k, axis=1)
        mass = problem.body.thickness * density[:, None] * shares
        return np.bincount(elements.ravel(), mass.ravel(), len(self.nodes)).astype(np.float64)


def all_nodes(exported: Exported) -> Whole:
    """Return all nodes of the potential."""
    potential, state = exported.path.potential, exported.state
    if not isinstance(potential, Refined):
        return nodes_of_the_mesh(exported)
    loading = potential.loading
    given = (loading.held, loading.motion(), exported.force_of(loading))
    return Whole(exported, potential.nodes, *given, None if state is None else state.all_positions, potential.elements)


def nodes_of_the_mesh(exported: Exported) -> Whole:
    """Return the nodes of the mesh alone."""
    positions = None if exported.state is None else exported.state.positions
    given = (exported.held, exported.motion, exported.external_force, positions)
    return Whole(exported, exported.problem.mesh.nodes, *given)
