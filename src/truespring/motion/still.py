"""Tools and grasps as they are at time 0, for the equilibrium from which a motion begins."""

from dataclasses import dataclass

from truespring.arrays import Floats, Ints
from truespring.conditions import Always, Interaction, Slide, Touch


@dataclass(frozen=True, eq=False)
class Still(Always):
    """A tool or a grasp that stays where it is at level 0, without friction; an Interaction.

    Attributes:
        moving: the tool or grasp.
    """

    moving: Interaction

    @property
    def name(self) -> str:
        """The name, for tables."""
        return self.moving.name

    @property
    def corners(self) -> tuple[float, ...]:
        """None: the path has one place."""
        return ()

    @property
    def dissipates(self) -> bool:
        """False: nothing slides."""
        return False

    def energy(self, positions: Floats, level: float) -> float:
        """Return the stored energy [J]; infinite where not allowed."""
        return self.moving.stored(positions, 0.0)

    def stored(self, positions: Floats, level: float) -> float:
        """Return the stored energy [J]."""
        return self.moving.stored(positions, 0.0)

    def gradient(self, positions: Floats, level: float) -> Floats:
        """Return minus the force on the nodes [N], shape (n_nodes, dim)."""
        return self.moving.gradient(positions, 0.0)

    def blocks(self, positions: Floats, level: float) -> tuple[Ints, Floats]:
        """Return nodes, shape (n,), and their second derivatives [N/m], shape (n, dim, dim), symmetric."""
        return self.moving.blocks(positions, 0.0)

    def since(self, positions: Floats, level: float, creep: float) -> "Still":
        """Return the same: there is no friction."""
        return self

    def lagged(self, positions: Floats, level: float) -> "Still":
        """Return the same: there is no friction."""
        return self

    def rubbed(self, force: Floats) -> "Still":
        """Return the same: there is no friction."""
        return self

    def slide(self, positions: Floats, level: float) -> Slide:
        """Return the friction of the tool at level 0."""
        return self.moving.slide(positions, 0.0)

    def cleared(self, positions: Floats, level: float) -> Floats:
        """Return positions of finite energy near others [m], shape (n_nodes, dim)."""
        return self.moving.cleared(positions, 0.0)

    def touch(self, positions: Floats, level: float) -> Touch:
        """Return place, force and depth at a state."""
        return self.moving.touch(positions, 0.0)

    def largest_stiffness(self) -> Floats:
        """Return an upper bound of the stiffness of each node [N/m], shape (n_nodes,)."""
        return self.moving.largest_stiffness()
