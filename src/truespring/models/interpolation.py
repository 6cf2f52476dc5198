"""The interpolation of finite elements: which of ELEMENTS a mesh allows, and when elements of first order lock."""

from truespring.errors import ModelError
from truespring.mesh import counted
from truespring.models.laws import LAWS
from truespring.problem import Problem

#: Kinds whose strain is uniform if they are of first order.
SIMPLICES = ("triangle", "tetrahedron")

#: Poisson's ratio above which elements of first order lock and others are the default.
LOCKING_POISSON = 0.4

#: Interpolations, values of `Fem.element`: quadratic ones for meshes of triangles or tetrahedra, mean dilatation for
#: other meshes.
ELEMENTS = ("linear", "mean-dilatation", "quadratic", "quadratic-mean-dilatation")


def chosen_interpolation(problem: Problem, law: str, asked: str | None = None) -> str:
    """Return the interpolation of a law on the mesh of a problem, one of ELEMENTS: `asked`, or the default.

    Raises ModelError if the mesh or the law does not allow `asked`.
    """
    if asked is None:
        usual, incompressible = default_interpolations(problem, law)
        return incompressible if locks(problem) else usual
    allowed = _allowed(problem, law)
    if asked not in allowed:
        within = f" in {problem.section.words}" if problem.section and _free_thickness(problem) else ""
        raise ModelError(
            f"element = '{asked}' is not available for {problem.mesh.kinds} elements{within} with law = '{law}'; "
            f"allowed: {', '.join(allowed)}"
        )
    return asked


def default_interpolations(problem: Problem, law: str) -> tuple[str, str]:
    """Return the default interpolations of a law: the usual one, and the one used where the usual one locks."""
    if problem.mesh.element not in SIMPLICES:
        return "linear", "mean-dilatation"
    return "quadratic", "quadratic" if LAWS[law].trace is None else "quadratic-mean-dilatation"


def _allowed(problem: Problem, law: str) -> tuple[str, ...]:
    """Return the interpolations that the mesh and the law allow."""
    found = dict.fromkeys(("linear", *default_interpolations(problem, law)))
    if _free_thickness(problem):  # the thickness changes freely: no locking
        found.pop("quadratic-mean-dilatation", None)
    return tuple(found)


def _free_thickness(problem: Problem) -> bool:
    """Return whether the thickness changes freely, as in plane stress."""
    return problem.section is not None and problem.section.free_thickness


def stiff_simplices(problem: Problem) -> tuple[str, ...]:
    """Return a warning if a mesh has triangles or tetrahedra and other kinds, which makes the simplices linear."""
    blocks = problem.mesh.blocks
    simplices = [counted(len(numbers), part.element) for numbers, part in blocks if part.element in SIMPLICES]
    if not simplices or len(blocks) == 1:
        return ()
    return (
        f"the {simplices[0]} are linear on a mesh of several kinds of elements: they are too stiff in bending and for "
        "nearly incompressible materials. Use few of them, away from regions of interest, or a mesh of this kind only, "
        "for which quadratic elements are the default",
    )


def locks(problem: Problem) -> bool:
    """Return whether linear elements lock: nearly incompressible material, thickness not free."""
    incompressible = any(material.poisson > LOCKING_POISSON for material in problem.materials)
    return incompressible and not _free_thickness(problem)


def locking_warnings(problem: Problem) -> tuple[str, ...]:
    """Return a warning if a model that equals linear finite elements locks."""
    if not locks(problem):
        return ()
    largest = max(material.poisson for material in problem.materials)
    return (
        f"at a Poisson's ratio of {largest:g} these elements lock, as linear finite elements do: they are too stiff; "
        'kind = "fem" has elements that do not lock',
    )
