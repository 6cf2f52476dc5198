"""The interpolation of finite elements: which of ELEMENTS a mesh allows, and where elements of first order lock."""

from truespring.errors import ModelError
from truespring.mesh import counted
from truespring.models.laws import LAWS
from truespring.problem import Problem

#: Kinds whose strain is one, as long as they are of first order.
SIMPLICES = ("triangle", "tetrahedron")

#: Above this Poisson's ratio elements of first order lock; others are then the default.
LOCKING_POISSON = 0.4

#: Interpolations of `Fem.element`: those that are quadratic for meshes of triangles or of tetrahedra, mean dilatation
#: for others.
ELEMENTS = ("linear", "mean-dilatation", "quadratic", "quadratic-mean-dilatation")


def chosen_interpolation(problem: Problem, law: str, asked: str | None = None) -> str:
    """Return the interpolation of a law on the problem's mesh, one of ELEMENTS: the one asked for, else the default.

    Raises ModelError where the mesh or the law does not allow the one asked for.
    """
    if asked is None:
        usual, incompressible = default_interpolations(problem, law)
        return incompressible if locks(problem) else usual
    allowed = _allowed(problem, law)
    if asked not in allowed:
        within = f" in {problem.section.words}" if problem.section and _free_thickness(problem) else ""
        raise ModelError(
            f"element = '{asked}' is not for a mesh of {problem.mesh.kinds} elements{within}; "
            f"allowed here: {', '.join(allowed)}"
        )
    return asked


def default_interpolations(problem: Problem, law: str) -> tuple[str, str]:
    """Return the default interpolations on the mesh: the usual one, and that where the usual one locks."""
    if problem.mesh.element not in SIMPLICES:
        return "linear", "mean-dilatation"
    return "quadratic", "quadratic" if LAWS[law].trace is None else "quadratic-mean-dilatation"


def _allowed(problem: Problem, law: str) -> tuple[str, ...]:
    """Return the interpolations that the mesh and the law allow."""
    found = dict.fromkeys(("linear", *default_interpolations(problem, law)))
    if _free_thickness(problem):  # the third direction is free to take lambda's part
        found.pop("quadratic-mean-dilatation", None)
    return tuple(found)


def _free_thickness(problem: Problem) -> bool:
    """Whether the body changes its thickness freely: plane stress."""
    return problem.section is not None and problem.section.free_thickness


def stiff_simplices(problem: Problem) -> tuple[str, ...]:
    """Return a warning where triangles or tetrahedra stand beside elements of other kinds: they are linear then."""
    blocks = problem.mesh.blocks
    simplices = [counted(len(numbers), part.element) for numbers, part in blocks if part.element in SIMPLICES]
    if not simplices or len(blocks) == 1:
        return ()
    return (
        f"the {simplices[0]} beside other kinds of elements are linear, too stiff in bending and where the material is "
        "nearly incompressible: keep them few and away from where it matters, or mesh the body with them alone: "
        "they are quadratic then",
    )


def locks(problem: Problem) -> bool:
    """Return whether linear elements are known to lock: nearly incompressible, and not free to change thickness."""
    incompressible = any(material.poisson > LOCKING_POISSON for material in problem.materials)
    return incompressible and not _free_thickness(problem)


def locking_warnings(problem: Problem) -> tuple[str, ...]:
    """Return what should be known of a model that is linear elements in another form: that these lock."""
    if not locks(problem):
        return ()
    largest = max(material.poisson for material in problem.materials)
    return (
        f"at a Poisson's ratio of {largest:g} these elements lock, as linear ones of FEM do: they are too stiff; "
        'kind = "fem" has elements that do not',
    )
