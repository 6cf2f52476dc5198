"""What a picture of a solution shows."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truespring.arrays import Floats
from truespring.report.bodies import picture_box
from truespring.report.touching import view
from truespring.showing.paints import Paint
from truespring.solution import Solution, State


@dataclass(frozen=True, eq=False)
class Scene:
    """A state of a solution over a reference.

    Attributes:
        solution, over: the two; `over` is None if the solution is alone.
        state: the state of the solution.
        mine, theirs: positions of their nodes, displacements magnified [m], shape (n_nodes, dim).
        factor: magnification of displacements.
        paint: values that are drawn as colours, None for one colour.
        title: words above the picture.
    """

    solution: Solution
    over: Solution | None
    state: State
    mine: Floats
    theirs: Floats | None
    factor: float
    paint: Paint | None
    title: str

    @property
    def rest(self) -> Floats:
        """The undeformed nodes [m], shape (n_nodes, dim)."""
        return self.solution.problem.mesh.nodes

    @cached_property
    def box(self) -> tuple[Floats, Floats]:
        """Lower and upper corner of what is shown in the picture plane [m], shape (2,), with a margin."""
        points = view(np.concatenate([self.rest, self.mine]))[:, :2]
        others = [] if self.theirs is None else [view(self.theirs)[:, :2]]
        lower, upper, _ = picture_box(points, others)
        margin = 0.04 * float((upper - lower).max())
        return lower - margin, upper + margin
