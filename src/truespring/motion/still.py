"""Tools and grasps as they are at one time, for the equilibrium of a body that is held there."""

from dataclasses import dataclass

from truespring.arrays import Floats, Ints
from truespring.conditions import Always, Interaction, Slide, Touch


@dataclass(frozen=True, eq=False)
class Still(Always):
    """A tool or a grasp that stays where it is at one level, without friction; an Interaction.

    Attributes:
        moving: the tool or grasp.
        place: the level.
    """

    moving: Interaction
    place: float = 0.0

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
        return self.moving.stored(positions, self.place)

    def stored(self, positions: Floats, level: float) -> float:
        """Return the stored energy [J]."""
        return self.moving.stored(positions, self.place)

    def gradient(self, positions: Floats, level: float) -> Floats:
        """Return minus the force on the nodes [N], shape (n_nodes, dim)."""
        return self.moving.gradient(positions, self.place)

    def blocks(self, positions: Floats, level: float) -> tuple[Ints, Floats]:
        """Return nodes, shape (n,), and their second derivatives [N/m], shape (n, dim, dim), symmetric."""
        return self.moving.blocks(positions, self.place)

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
        """Return the friction of the tool at that level."""
        return self.moving.slide(positions, self.place)

    def cleared(self, positions: Floats, level: float) -> Floats:
        """Return positions of finite energy near others [m], shape (n_nodes, dim)."""
        return self.moving.cleared(positions, self.place)

    def touch(self, positions: Floats, level: float) -> Touch:
        """Return place, force and depth at a state."""
        return self.moving.touch(positions, self.place)

    def largest_stiffness(self) -> Floats:
        """Return an upper bound of the stiffness of each node [N/m], shape (n_nodes,)."""
        return self.moving.largest_stiffness()
