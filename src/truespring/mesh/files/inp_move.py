"""Placement of an instance: the data lines of *INSTANCE.

Source: "Assembly definition" in the manual of Abaqus.
"""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.mesh.files.inp_cards import Card, fields


@dataclass(frozen=True)
class Move:
    """Rigid motion of an instance: translation, then rotation about `origin`."""

    translation: Floats
    origin: Floats
    rotation: Floats

    def __call__(self, points: Floats) -> Floats:
        """Return the moved points, shape (n, 3)."""
        return np.asarray((points + self.translation - self.origin) @ self.rotation.T + self.origin)


def read_move(card: Card) -> Move | None:
    """Read the data lines of *INSTANCE: x, y, z; then two points of the axis and degrees. None if there are none."""
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
            raise card.error(f"expected x, y, z, or two points and an angle, found {len(values)} numbers", place)
    if not card.rows:
        return None
    return Move(translation, origin, rotation)


def _rotation(axis: Floats, angle: float) -> Floats:
    """Return the rotation matrix by Rodrigues' formula, shape (3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
