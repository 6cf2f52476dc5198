"""Stiffness rules: from a material and an element to the stiffness of the element's springs.

A rule is one function of the problem that returns stiffness [N/m], shape (n_elements, links), in
the order of `ElementKind.links`, and one line in RULES. What the springs realise is computed from
the result (`moduli`), so that no rule needs to be believed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError
from truespring.material import Material, Section
from truespring.models.fem import element_matrices
from truespring.problem import Problem


@dataclass(frozen=True, slots=True)
class Rule:
    """A table entry: the recipe, what it is good for and where it comes from."""

    stiffness: Callable[[Problem], Floats]
    summary: str
    source: str


@dataclass(frozen=True, slots=True)
class UserStiffness:
    """Stiffness of the user's own: of edges and diagonals, in units of thickness times Young's modulus."""

    edge: float
    diagonal: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.edge) and np.isfinite(self.diagonal)):
            raise ModelError(f"stiffness = {{ edge = {self.edge}, diagonal = {self.diagonal} }}: must be finite")


def element_stiffness(problem: Problem, rule: str | None, user: UserStiffness | None = None) -> Floats:
    """Return the stiffness of each element's springs [N/m], shape (n_elements, links)."""
    require_body(problem)
    if user is not None:
        return _edges_and_diagonals(problem, user.edge, user.diagonal)
    return RULES[str(rule)].stiffness(problem)


def require_body(problem: Problem) -> tuple[Material, Section]:
    """Return material and section; raise ModelError where the problem is a plain network."""
    if problem.material is None or problem.section is None or problem.mesh.element == "line":
        raise ModelError("a model of a body needs a mesh of elements, a material and a section")
    return problem.material, problem.section


def _edges_and_diagonals(problem: Problem, edge: float, diagonal: float) -> Floats:
    """Coefficients times thickness times Young's modulus, the same in every element."""
    material, section = require_body(problem)
    kind = problem.mesh.kind
    coefficients = np.array([edge] * len(kind.edges) + [diagonal] * len(kind.diagonals))
    return np.tile(coefficients * section.thickness * material.young, (len(problem.mesh.elements), 1))


def _sides(problem: Problem, rule: str) -> tuple[Floats, Floats]:
    """Return the two side lengths of each element [m]; raise ModelError where one is no rectangle."""
    mesh = problem.mesh
    at = mesh.nodes[mesh.elements]
    first, second = at[:, 1] - at[:, 0], at[:, 3] - at[:, 0]
    l_first, l_second = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
    skew = np.abs((first * second).sum(axis=1)) / (l_first * l_second)
    open_by = np.linalg.norm(at[:, 2] - at[:, 0] - first - second, axis=1) / np.maximum(l_first, l_second)
    wrong = np.flatnonzero(np.maximum(skew, open_by) > 1e-6)
    if wrong.size:
        raise ModelError(
            f"rule = '{rule}' is made for rectangles, {wrong.size} elements are none, "
            f"the first is element {wrong[0]}; allowed here: projected, least-squares"
        )
    return np.asarray(l_first), np.asarray(l_second)


def lloyd(problem: Problem) -> Floats:
    """Edges 5/16, diagonals 7/16 of thickness times E, on squares.

    Lembryk and Ciszkiewicz, equations 1 and 2, after Lloyd, Szekely, Harders (2007).
    """
    l_first, l_second = _sides(problem, "lloyd")
    unequal = np.abs(l_first / l_second - 1)
    if unequal.max() > 1e-6:
        worst = int(unequal.argmax())
        raise ModelError(
            f"rule = 'lloyd' is made for squares, the elements measure {l_first[worst]:g} m by {l_second[worst]:g} m: "
            "choose size and elements so that they are squares, or the rule isotropic, projected or least-squares"
        )
    return _edges_and_diagonals(problem, 5 / 16, 7 / 16)


def isotropic(problem: Problem) -> Floats:
    """Springs whose lattice is isotropic with the material's E in plane stress and Poisson's ratio 1/3.

    Squares: 3/8 on edges and diagonals (Brisard, "What is homogenization?", part 4; the only such pair).
    Rectangles a by b, per t E: k_a = 3 (3 b^2 - a^2) / (16 a b), k_d = 3 (a^2 + b^2) / (16 a b), the member
    for Poisson's ratio 1/3 of Baudet et al. (2009); an edge turns negative beyond an aspect of sqrt(3).
    """
    material, section = require_body(problem)
    first, second = _sides(problem, "isotropic")
    scale = 3 * section.thickness * material.young / (16 * first * second)
    k_first, k_second = scale * (3 * second**2 - first**2), scale * (3 * first**2 - second**2)
    k_diagonal = scale * (first**2 + second**2)
    return np.stack([k_first, k_second, k_first, k_second, k_diagonal, k_diagonal], axis=1)


def projected(problem: Problem) -> Floats:
    """k = -n . K_ij n with the blocks K_ij of the element's own linear FEM matrix.

    The least-squares fit of the off-diagonal blocks alone. On squares in plane stress at Poisson's
    ratio 1/3 it gives Lloyd's 5/16 and 7/16.
    """
    links, direction = _link_directions(problem)
    blocks = _blocks(problem)
    off_diagonal = blocks[:, links[:, 0], :, links[:, 1], :].swapaxes(0, 1)
    return np.asarray(-np.einsum("eli,elij,elj->el", direction, off_diagonal, direction))


def least_squares(problem: Problem) -> Floats:
    """The springs whose element matrix is nearest to the FEM one, all entries counted alike (Frobenius).

    A spring's matrix is b b^T with b = (-n, n) on its ends; the normal equations are
    sum_t (b_s . b_t)^2 k_t = b_s . K b_s. Squares in plane stress, Poisson's ratio nu:
    (6 - nu) / (21 (1 - nu^2)) on edges, (15 + nu) / (42 (1 - nu^2)) on diagonals.
    """
    links, direction = _link_directions(problem)
    blocks = _blocks(problem)
    n_elements, n_nodes, dim = blocks.shape[:3]
    stencil = np.zeros((n_elements, len(links), n_nodes, dim))
    every = np.arange(len(links))
    stencil[:, every, links[:, 0]], stencil[:, every, links[:, 1]] = -direction, direction
    gram = np.einsum("esai,etai->est", stencil, stencil) ** 2
    target = np.einsum("esai,eaibj,esbj->es", stencil, blocks, stencil)
    return np.asarray(np.linalg.solve(gram, target[:, :, None])[:, :, 0])


def _link_directions(problem: Problem) -> tuple[Floats, Floats]:
    """Local node pairs, shape (links, 2), and unit vectors, shape (n_elements, links, dim)."""
    mesh = problem.mesh
    links = np.array(mesh.kind.links)
    at = mesh.nodes[mesh.elements]
    across = at[:, links[:, 1]] - at[:, links[:, 0]]
    return links, across / np.linalg.norm(across, axis=2, keepdims=True)


def _blocks(problem: Problem) -> Floats:
    """Linear FEM element matrices as blocks [N/m], shape (n_elements, nodes, dim, nodes, dim)."""
    mesh = problem.mesh
    n_nodes = mesh.elements.shape[1]
    return element_matrices(problem).reshape(-1, n_nodes, mesh.dim, n_nodes, mesh.dim)


RULES: MappingProxyType[str, Rule] = MappingProxyType(
    {
        "lloyd": Rule(
            lloyd,
            "5/16 and 7/16 on squares; soft along the edges, stiff along the diagonals",
            "Lembryk and Ciszkiewicz, equations 1 and 2, after Lloyd et al. 2007",
        ),
        "isotropic": Rule(
            isotropic,
            "3/8 and 3/8 on squares; exact modulus in every direction, Poisson's ratio 1/3",
            "Brisard, What is homogenization? part 4; rectangles: Baudet et al. 2009",
        ),
        "least-squares": Rule(
            least_squares,
            "nearest to the element's FEM matrix, all entries",
            "the norm of Lloyd et al. 2007 for tetrahedra, applied to the quadrilateral",
        ),
        "projected": Rule(
            projected,
            "nearest to the off-diagonal blocks of the element's FEM matrix",
            "after Lloyd et al. 2007; equals Van Gelder 1998 on triangles",
        ),
    }
)
