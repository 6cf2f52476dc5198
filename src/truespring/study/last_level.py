"""Studies that can be judged by their last level: in equilibrium, with the largest load and motion at the end."""

from collections.abc import Iterator

import numpy as np

from truespring.errors import StudyError
from truespring.study.places import Key
from truespring.study.read import Study
from truespring.tools import varies

# Distances from the begin of a path that differ by this share are equal.
_EQUAL = 1e-9


def require_last_level(study: Study, verb: str, in_proportion: bool = False) -> None:
    """Raise StudyError if a study moves in time, or if a load, a support or a tool returns before the end.

    Args:
        study: the study.
        verb: the verb that compares last levels, for the message.
        in_proportion: whether histories, and tools and grasps that move, are errors in any case: the verb scales loads
            and supports.
    """
    for key, text in _obstacles(study, verb, in_proportion):
        raise StudyError(f"{study.text.places.of(key)}: {text}")


def _obstacles(study: Study, verb: str, in_proportion: bool) -> Iterator[tuple[Key, str]]:
    """Yield the keys that do not fit, and why with the way out."""
    problem = study.problem
    by_end = f"{verb} compares the ends of the paths"
    if problem.dynamics is not None:
        yield (
            ("dynamics",),
            f"{verb} is for equilibria: leave [dynamics] out; motions are for solve, verify, sweep and compare",
        )
    for kind, several in (("load", problem.loads), ("support", problem.supports)):
        for number, over in enumerate(one.over for one in several):
            if over is None:
                continue
            shares = [float(share) for _, share in over]
            if in_proportion:
                yield (kind, number, "over"), f"{verb} varies loads in proportion: leave over out"
            elif abs(shares[-1]) < max(map(abs, shares)):
                largest = max(shares, key=abs)
                yield (
                    (kind, number, "over"),
                    f"ends at {shares[-1]:g}, below {largest:g}, but {by_end}: end at {largest:g}",
                )
    for table, ones in (("tool", problem.tools), ("grasp", problem.grasps)):
        for number, (path, during) in enumerate((one.path, one.during) for one in ones):
            if during is not None and in_proportion:
                yield (table, number, "during"), f"{verb} varies loads in proportion: leave during out"
            elif during is not None and during[1] < 1 - _EQUAL:
                yield (table, number, "during"), f"ends at {during[1]:g}, but {by_end}: end at 1"
            if not varies(path):
                continue
            places = np.asarray(path, dtype=float)[:, 1:]
            far = np.linalg.norm(places - places[0], axis=1)
            if in_proportion:
                yield (
                    (table, number, "path"),
                    f"{verb} varies loads and supports, not paths: give one place, which does not move",
                )
            elif far[-1] < (1 - _EQUAL) * far.max():
                yield (
                    (table, number, "path"),
                    f"ends nearer to its begin than before, but {by_end}: end where it is farthest",
                )
