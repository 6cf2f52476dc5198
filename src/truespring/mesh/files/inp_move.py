"""Where an instance is placed: the data lines of *INSTANCE.

Source: "Assembly definition" in the manual of Abaqus.
"""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.mesh.files.inp_cards import Card, fields


@dataclass(frozen=True)
class Move:
    """How an instance is placed: moved by `translation`, then turned by `rotation` about `origin`."""

    translation: Floats
    origin: Floats
    rotation: Floats

    def __call__(self, points: Floats) -> Floats:
        """Return points of shape (n, 3) where they are placed."""
        return np.asarray((points + self.translation - self.origin) @ self.rotation.T + self.origin)


def read_move(card: Card) -> Move | None:
    """Return how the data lines of *INSTANCE place it, None for as it is: x, y, z; then two points and degrees."""
    translation, origin, rotation = np.zeros(3), np.zeros(3), np.eye(3)
    for text, place in zip(card.rows, card.places, strict=True):
        row = [one if one.strip() else b"0" for one in fields(text)]
        values = card.reals([row], [place], "the place of an instance")
        if len(values) <= 3:
            translation[: len(values)] += values
        elif len(values) == 7:
            origin, axis = values[:3], values[3:6] - values[:3]
            length = float(np.linalg.norm(axis))
            if not length:
                raise card.error("the two points of the axis coincide", place)
            rotation = _rotation(axis / length, float(np.radians(values[6])))
        else:
            raise card.error(f"x, y, z, or two points and an angle are wanted, found {len(values)} numbers", place)
    if not card.rows:
        return None
    return Move(translation, origin, rotation)


def _rotation(axis: Floats, angle: float) -> Floats:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
