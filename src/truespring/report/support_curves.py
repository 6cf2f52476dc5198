"""Curves of the force and the torque of each moved support."""

from collections.abc import Iterator

import numpy as np

from truespring.arrays import Floats
from truespring.equilibrium import Solution
from truespring.reactions import SupportForce, leading_support, moved_supports, support_name
from truespring.report.axis import axis_of
from truespring.report.plots import Curve, plot
from truespring.report.quantity import natural_scale
from truespring.report.result import Result
from truespring.report.sheet import Sheet
from truespring.report.style import is_strong, label_and_name, path_styles

_UNITS = {"force": "N", "torque": "N m"}


def support_figures(result: Result) -> Iterator[tuple[str, Sheet]]:
    """Yield a figure of each force and torque that does not vanish, with the stem of its file name.

    The support that moves most comes first; its first figure is "reactions", the others are numbered from 2. The force
    of the only support that is moved without a turn, without loads, is left out: it is the total force, which the curve
    of the probe shows.
    """
    problem = result.problem
    leading, moved = leading_support(problem), moved_supports(problem)
    number = 0
    for support in sorted(moved, key=lambda one: one != leading):
        held = problem.held[support]
        only_turned = held.turn is not None and not held.motion.any()
        is_total = problem.loading.driven_by_motion and held.turn is None and len(moved) == 1
        for quantity in ("torque", "force") if only_turned else ("force", "torque"):
            values = {name: _values(path, support, quantity) for name, path in result.solutions.items()}
            if (is_total and quantity == "force") or not any(has for has, _, _ in values.values()):
                continue
            number += 1
            at = {name: (levels, sizes) for name, (_, levels, sizes) in values.items() if levels.size}
            yield "reactions" if number == 1 else f"reactions_{number}", _figure(result, support, quantity, at)


def _values(path: Solution, support: int, quantity: str) -> tuple[bool, Floats, Floats]:
    """Return whether a resultant does not vanish, the load factors where it is known, and its values there [N, N m].

    A force is that along the motion, a torque that about the axis of the turn; without these, their size.
    """
    found = [
        (state.load_factor, one)
        for state in path.states
        for one in path.support_forces(state)
        if one.support == support
    ]
    there = [one.has_force if quantity == "force" else one.has_torque for _, one in found]
    sizes = np.array([_along(path, one, quantity) for _, one in found])
    return any(there), np.array([level for level, _ in found]), sizes


def _along(path: Solution, one: SupportForce, quantity: str) -> float:
    held = path.problem.held[one.support]
    if quantity == "force":
        way = held.motion
        vector = one.force
    else:
        way = np.zeros(0) if held.turn is None else np.atleast_1d(held.turn.axis if len(one.torque) == 3 else 1.0)
        vector = one.torque
    if len(vector) == 1:
        return float(vector[0])
    return float(vector @ way / np.linalg.norm(way)) if way.any() else float(np.linalg.norm(vector))


def _figure(result: Result, support: int, quantity: str, values: dict[str, tuple[Floats, Floats]]) -> Sheet:
    """Return displacement or rotation of the support over its force or torque; over time or way, that of these."""
    problem, axis, styles = result.problem, axis_of(result), path_styles(result)
    held = problem.held[support]
    turned = held.turn is not None and (quantity == "torque" or not held.motion.any())
    most = np.degrees(held.turn.angle) if turned and held.turn is not None else float(np.linalg.norm(held.motion))
    scale = natural_scale(max(float(np.abs(sizes).max()) for _, sizes in values.values()), _UNITS[quantity])
    length = natural_scale(most, "m")
    by_level = axis.moves or problem.returns
    curves = []
    for name, (levels, sizes) in values.items():
        share = np.array([problem.share_of_support(support, level) for level in levels])
        way = share * most / (1.0 if turned else length.size)
        x, y = (axis.value(levels), sizes / scale.size) if by_level else (sizes / scale.size, way)
        label = "\n".join(label_and_name(result, name))
        curves.append(Curve(x, y, *styles[name], label=label, strong=is_strong(result, name)))
    labels = [f"{quantity} of the support [{scale.unit}]"]
    labels.append("rotation [degrees]" if turned else f"displacement of the support [{length.unit}]")
    labels = [axis.label, labels[0]] if by_level else labels
    several = len(moved_supports(problem)) > 1
    where = f"support {support + 1}, {support_name(problem, support)}" if several else "the moved support"
    return plot(f"{quantity.capitalize()} of {where}", labels[0], labels[1], curves).sheet
