"""What the twin of a session found: states of another model, or of shorter steps, at times of the session."""

from dataclasses import dataclass

from truespring.arrays import Floats


@dataclass(frozen=True, eq=False)
class Ghost:
    """A state to compare the session with, at the session's time.

    Attributes:
        time: time of the session that it belongs to [s].
        kind: "rest": the reference's equilibrium under what holds the body at that time; "moving": the reference's own
            motion; "finer": the session's own model with steps of half the length; "solved": the session's
            own model after a frame whose steps were solved to the end.
        positions: of the nodes of the mesh [m], shape (n_nodes, dim).
        own: of "rest", the equilibrium of the session's own model [m], shape (n_nodes, dim), of "solved" its frame with
            steps as in the session; None if it is not known.
        since: time at which a motion began as that of the session, or from rest [s].
        coarse: number of nodes of the mesh of larger cells on which the difference of both models was found, which was
            added to the session's positions; 0 for its own mesh.
        order: of "finer", the order of the scheme in the step.
        says: how it was found, in a few words.
        run: number of restarts of the session before it.
    """

    time: float
    kind: str
    positions: Floats
    own: Floats | None = None
    since: float = 0.0
    coarse: int = 0
    order: int = 2
    says: str = ""
    run: int = 0
