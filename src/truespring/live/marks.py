"""What acts on the body of a session, for its page."""

from collections.abc import Collection

from truespring.live.session import Live
from truespring.live.snapshot import Mark


def marks_of(live: Live, pins: Collection[str]) -> tuple[Mark, ...]:
    """Return grasps, pins and spheres as they are now; `pins` are the names of those grasps that are pins."""
    positions = live.moment.positions
    grasps = [
        Mark("pin" if name in pins else "grasp", name, one.radius, one.place, one.at + one.mean_motion(positions))
        for name, one in live.grasps.items()
    ]
    return (*grasps, *(Mark("sphere", name, one.radius, one.place, one.place) for name, one in live.spheres.items()))
