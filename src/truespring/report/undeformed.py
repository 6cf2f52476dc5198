"""The undeformed body of a figure: mesh, springs, supports, loads and the probe."""

from dataclasses import dataclass

from truespring.arrays import Ints
from truespring.conditions import Refined
from truespring.potential import Stretched, Visible
from truespring.problem import Problem
from truespring.report.legend import Entry
from truespring.report.result import Result
from truespring.report.style import BLUE, INK, RED


@dataclass(frozen=True, eq=False, slots=True)
class Undeformed:
    """An undeformed body.

    Attributes:
        problem: mesh, supports and loads.
        probe: number of the watched node; None if it is not known before solving.
        springs: pairs of nodes joined by springs, shape (n, 2); None without springs. See `spring_lines`.
        springs_are: "springs", "links" or "edges".
        is_cloud: whether the body was read as points without elements.
    """

    problem: Problem
    probe: int | None
    springs: Ints | None
    springs_are: str = "springs"
    is_cloud: bool = False

    @property
    def title(self) -> str:
        """The title of the picture: counts of nodes, elements and springs."""
        mesh = self.problem.mesh
        counts = [f"{mesh.n_nodes} {'markers' if self.is_cloud else 'nodes'}"]
        counts += [] if self.is_cloud else [f"{len(mesh.elements)} elements"]
        counts += [f"{len(self.springs)} {self.springs_are}"] if self.springs is not None else []
        return f"Undeformed: {', '.join(counts)}"

    @property
    def has_elements(self) -> bool:
        """Whether elements are drawn: of a network only if its springs, which are at the same places, are not."""
        return not self.is_cloud and (self.problem.mesh.element != "line" or self.springs is None)

    @property
    def legend(self) -> tuple[Entry, ...]:
        """The legend: what is drawn."""
        entries = [Entry("elements", INK)] if self.has_elements else []
        entries += [Entry(self.springs_are, BLUE)] if self.springs is not None else []
        entries += [Entry("probe", RED, "o", "")] if self.probe is not None else []
        return tuple(entries)


def spring_lines(potential: object) -> Ints | None:
    """Return the pairs of nodes joined by the springs of a potential, shape (n, 2); None without springs.

    If there are springs to nodes that are not in the mesh, return the lines of the potential between nodes of the mesh.
    """
    if not isinstance(potential, Stretched):
        return None
    if isinstance(potential, Refined) and isinstance(potential, Visible):
        return potential.cells["line"]
    return potential.springs


def undeformed_of(result: Result) -> Undeformed:
    """Return the undeformed body of a result, with the springs of the compared or, without one, the first model."""
    model = result.solutions.get(result.model or "") or next(iter(result.solutions.values()))
    return Undeformed(result.problem, result.probe, spring_lines(model.potential), model.lines, model.is_cloud)
