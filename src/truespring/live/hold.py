"""A body held still: the equilibria of the session's model and of the reference, the quick ones first."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Refined, from_parents
from truespring.live.rest import CoarseRest, Rest, coarse_rest, steady
from truespring.live.session import Live
from truespring.live.state import State
from truespring.potential import Potential

# An equilibrium that may take longer is found on a coarser mesh first [s]; the number of nodes that takes so long if
# none was found yet.
_QUICK, _MANY = 1.0, 3000


@dataclass(frozen=True, eq=False)
class Found:
    """Equilibria of a body that is held still.

    Attributes:
        reference: of the reference, positions of all its nodes [m], shape (n_nodes, dim).
        own: of the session's model [m], shape (n_nodes, dim); None if it is not known, or not known yet.
        coarse: number of nodes of the mesh of larger cells by which the reference is estimated, else 0.
    """

    reference: Floats
    own: Floats | None
    coarse: int = 0


class Resting:
    """The equilibria of one session's body, with what is kept from one to the next."""

    def __init__(self) -> None:
        """Begin without a body: it is that of the session at each call of `find`."""
        self.last: Floats | None = None
        self._known: tuple[Potential, Rest] | None = None
        self._coarse: tuple[Potential, CoarseRest | None] | None = None
        self._seconds: float | None = None

    def find(self, live: Live, held: State, starts: Sequence[Floats], stop: Callable[[], bool]) -> Floats | None:
        """Return the equilibrium [m], shape (n_nodes, dim), of the body of a session held as in a state.

        None if none was found. `starts` [m], shape (n, dim), are tried after the last one, those of less energy first;
        they may lack the further nodes of second-order elements. See `Rest.find` for `stop`.
        """
        potential = live.body.potential
        if self._known is None or self._known[0] is not potential:
            self._known = potential, Rest.of(live.body, live.geometry)
        several = [*starts] if self.last is None else [self.last, *starts]
        fitting = [one for each in several if (one := on_all_nodes(potential, each)) is not None]
        begun, interrupted = time.perf_counter(), True
        try:
            found = self._known[1].find(steady(live, held), fitting, stop)
            if found is None:
                found = self._known[1].approach(steady(live, held, grow=True), stop)
            interrupted = False
        finally:
            taken = time.perf_counter() - begun
            self._seconds = max(self._seconds or 0.0, taken) if interrupted else taken
        self.last = self.last if found is None else found
        return found

    def takes_long(self, live: Live) -> bool:
        """Return whether an equilibrium may take more than about a second."""
        return live.problem.mesh.n_nodes > _MANY if self._seconds is None else self._seconds > _QUICK

    def roughly(self, live: Live, held: State, start: Floats, stop: Callable[[], bool]) -> Found | None:
        """Return the equilibrium on a mesh of larger cells, interpolated; None if there is none. See `find`."""
        potential = live.body.potential
        if self._coarse is None or self._coarse[0] is not potential:
            self._coarse = potential, coarse_rest(live)
        coarse = self._coarse[1]
        if coarse is None:
            return None
        found = coarse.find(steady(live, held), start, stop)
        return None if found is None else Found(found, None, coarse.n_nodes)


@dataclass
class Hold:
    """Both models at rest.

    Attributes:
        reference: equilibria of the reference.
        own: those of the session's model.
    """

    reference: Resting = field(default_factory=Resting)
    own: Resting = field(default_factory=Resting)

    def follow(self, live: Live, same: Live, held: State, stop: Callable[[], bool]) -> Iterator[Found]:
        """Yield what is found, the last from the reference's own mesh; nothing if there is no equilibrium.

        Args:
            live: a session of the reference.
            same: one of the session's model.
            held: the state of the session when it was held still.
            stop: asked after each iteration whether to give up: then InterruptedSearchError is raised.
        """
        here = held.moment.positions[: live.problem.mesh.n_nodes]
        rough = self._roughly(live, same, held, stop) if self.reference.takes_long(live) else None
        if rough is not None:
            yield rough
        own = self.own.find(same, held, [held.moment.positions], stop)
        own = None if own is None else own[: len(here)]
        starts = [here, *([] if own is None else [own]), *([] if rough is None else [rough.reference])]
        fine = self.reference.find(live, held, starts, stop)
        if fine is not None:
            yield Found(fine, own)

    def _roughly(self, live: Live, same: Live, held: State, stop: Callable[[], bool]) -> Found | None:
        """Return an estimate of the reference: the state plus the difference of both models on a mesh of larger cells.

        The error of that mesh, common to both, cancels. None without such a mesh. Arguments as `follow`.
        """
        here = held.moment.positions
        n_nodes = live.problem.mesh.n_nodes
        if here.shape != live.problem.mesh.nodes.shape:
            return None
        right, own = (one.roughly(body, held, here, stop) for one, body in ((self.reference, live), (self.own, same)))
        if right is None or own is None:
            return None
        return Found(here + right.reference[:n_nodes] - own.reference[:n_nodes], None, right.coarse)


def on_all_nodes(potential: Potential, positions: Floats) -> Floats | None:
    """Return positions of all nodes of a potential from those of the mesh [m]; None if their number differs."""
    nodes = potential.nodes
    if positions.shape == nodes.shape:
        return positions
    if not isinstance(potential, Refined) or len(positions) != len(nodes) - len(potential.parents):
        return None
    moved = from_parents(potential.parents, len(positions)) @ (positions - nodes[: len(positions)])
    return np.asarray(nodes + moved)
