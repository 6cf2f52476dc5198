"""What a picture of a solution shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truespring.arrays import Floats
from truespring.mesh import Mesh
from truespring.report.bodies import picture_box
from truespring.report.touching import Drawn, near
from truespring.showing.paints import Paint
from truespring.showing.shapes import Shape


@dataclass(frozen=True, eq=False)
class Scene:
    """A body over a reference, in the coordinates of the picture.

    Attributes:
        mesh: the mesh of the body, to which the values of `paint` refer.
        rest, mine, theirs: the body undeformed and deformed, and the reference; None if there is none.
        paint: values that are drawn as colours, None for one colour.
        tools: tools and grasps.
        frame: lower and upper corner of what is shown [m], shape (2,); by default as `box`.
    """

    mesh: Mesh
    rest: Shape | None
    mine: Shape
    theirs: Shape | None = None
    paint: Paint | None = None
    tools: Sequence[Drawn] = ()
    frame: tuple[Floats, Floats] | None = None

    @property
    def is_plane(self) -> bool:
        """Whether the bodies are plane."""
        return bool(self.mine.points.shape[1] == 2)

    @cached_property
    def box(self) -> tuple[Floats, Floats]:
        """Lower and upper corner of what is shown in the picture plane [m], shape (2,), with a margin."""
        if self.frame is not None:
            return self.frame
        own = [one.points[:, :2] for one in (self.rest, self.mine) if one is not None]
        others = [] if self.theirs is None else [self.theirs.points[:, :2]]
        lower, upper, _ = picture_box(np.concatenate(own), others)
        corners = np.concatenate([near(self.tools, lower, upper), lower[None], upper[None]])
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        margin = 0.04 * float((upper - lower).max())
        return lower - margin, upper + margin
