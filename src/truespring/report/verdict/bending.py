"""The bending stiffness of the reference's elements on this mesh."""

from truespring.models import Fem
from truespring.report.quantity import percent
from truespring.report.result import Result
from truespring.report.verdict.drive import drive
from truespring.report.verdict.naming import ELEMENTS, deep


def mesh_sentence(result: Result) -> str | None:
    """Return the error of the reference's elements in bending; None if it is below 1 % or unknown.

    The moduli of the springs hold this error for the default elements and for bending along x, so it is given for
    bodies driven along y only.
    """
    known = next((path.moduli for path in result.solutions.values() if path.moduli is not None), None)
    used = {one.reference.element for one in result.comparisons.values()}
    if known is None or known.depth is None or drive(result).axis != 1:
        return None
    if Fem("linear").chosen_element(result.problem) not in used:
        return None
    excess = known.fem_bending[known.depth] - 1
    if abs(excess) <= 0.01:
        return None
    stiff = "stiff" if excess > 0 else "soft"
    return (
        f"The {ELEMENTS[result.problem.mesh.element]} themselves are {percent(abs(excess))} too {stiff} in "
        f"bending on this mesh ({deep(known.depth)}): a refined mesh shows how much of the distance is due to them."
    )
