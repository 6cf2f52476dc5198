"""Stiffness rules: the stiffness of the springs of an element, from its shape and material.

A rule consists of a function of the problem that returns stiffness [N/m], shape (n_elements, links), in the order of
`ElementKind.links`, and an entry of RULES. The tests compare the effective moduli that the entry states with those that
`moduli` computes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError, nearest
from truespring.material import Material, Section
from truespring.memory import slices
from truespring.mesh import Mesh
from truespring.mesh.rows import distinct_rows
from truespring.models.biquadratic import BiquadraticSprings
from truespring.models.fem_potential import fem_of_one_kind
from truespring.models.gaussian_rule import GAUSSIAN_LAWS, gaussian_potential, gaussian_stiffness
from truespring.models.interpolation import SIMPLICES
from truespring.models.laws import LAWS
from truespring.models.linked import LinkedElements
from truespring.models.links import CORNERS, by_kind, link_coupling, link_vectors
from truespring.models.pair_laws import PAIR_LAWS, STRAIGHT
from truespring.models.summed import SummedLinks, summed_links
from truespring.plugins import Table
from truespring.potential import Stressed
from truespring.problem import Problem, sample

# Largest stiffness of each body diagonal of a cube in the rule `isotropic`, in E h.
_LARGEST_K_BODY = 0.3

#: Value of `LatticeModuli.lattice` for moduli that hold on all meshes.
ANY_MESH = "any mesh"


@dataclass(frozen=True, slots=True)
class LatticeModuli:
    """Effective moduli of a rule on a lattice, in plane stress or 3D; the tests compare them with `moduli`.

    Attributes:
        lattice: a key of LATTICES, or ANY_MESH.
        young: smallest and largest Young's modulus over all directions, over that of the material [-].
        poisson: smallest and largest Poisson's ratio over all directions [-]; None if it is that of the material.
        at: Poisson's ratio of the material for which the moduli hold [-]; None for any.
    """

    lattice: str
    young: tuple[float, float] = (1.0, 1.0)
    poisson: tuple[float, float] | None = None
    at: float | None = None

    def __str__(self) -> str:
        where = self.lattice + ("" if self.at is None else f" (nu = {_number(self.at)})")
        lowest, highest = (_number(value) for value in self.young)
        young = "E" if lowest == highest == "1" else f"{lowest} E" if lowest == highest else f"{lowest} to {highest} E"
        if self.poisson is None:
            return f"{where}: {young}, Poisson's ratio of the material"
        smallest, largest = (_number(value) for value in self.poisson)
        return f"{where}: {young}, Poisson's ratio {smallest if smallest == largest else f'{smallest} to {largest}'}"


def _number(value: float) -> str:
    """Return a value as a fraction of small integers if it is one, else with three digits."""
    found = Fraction(value).limit_denominator(4)
    return str(found) if abs(float(found) - value) < 1e-9 else f"{value:.3f}"


@dataclass(frozen=True, slots=True)
class Rule:
    """An entry of RULES. The contract tests (`tests/test_rules.py`) check all its attributes.

    Attributes:
        stiffness: returns the stiffness of each element's links [N/m], shape (n_elements, links), of a problem and the
            given `parameters` by name.
        elements: supported kinds of element, keys of ELEMENT_KINDS.
        idea: how the stiffness is determined, in a few words.
        moduli: effective moduli, on at least one lattice of each kind of element.
        source: publication.
        shapes: required shape, by kind of element: "square", "rectangle" or "brick"; no entry for any shape.
        parameters: optional parameters, attributes of Springs.
        potential: returns the potential of a problem and `parameters` by name, if a spring's force depends on other
            nodes of the element, too; None for plain springs. `stiffness` is then that of a spring while the other
            lengths are constant, of all kinds of elements of a problem.
        laws: allowed values of `law`: keys of PAIR_LAWS for plain springs, constitutive laws for a potential; empty if
            the springs have no other law.
        locks_on: kinds of elements on which such a potential locks near Poisson's ratio 1/2.
        remark: a sentence on cost and law of such a potential, without a full stop.
        takes_fibres: whether such a potential includes the fibres of the material.
    """

    stiffness: Callable[..., Floats]
    elements: tuple[str, ...]
    idea: str
    moduli: tuple[LatticeModuli, ...]
    source: str
    shapes: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    parameters: tuple[str, ...] = ()
    potential: Callable[..., Stressed] | None = None
    laws: Sequence[str] = ()
    locks_on: tuple[str, ...] = ()
    remark: str = ""
    takes_fibres: bool = False

    @property
    def coupled(self) -> bool:
        """Whether the force of a spring depends also on other nodes of the element; moduli are then exact."""
        return self.potential is not None

    def takes(self, mesh: Mesh) -> bool:
        """Return whether the rule supports all kinds of elements of a mesh."""
        return all(kind in self.elements for kind in mesh.element_kinds)

    @property
    def realises(self) -> str:
        """Effective moduli in words, in terms of the Young's modulus E of the material."""
        return "; ".join(str(one) for one in self.moduli)


@dataclass(frozen=True, slots=True)
class UserStiffness:
    """User-defined stiffness of edges, face diagonals and body diagonals.

    In units of t E in 2D, thickness times Young's modulus, and of E h in 3D, h the edge of a cube of the same volume as
    the element.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> ts.solve(problem, ts.Springs(stiffness=ts.UserStiffness(edge=0.375, diagonal=0.375)))
        Solution(springs (own stiffness), converged, 11 states up to load factor 1)
    """

    edge: float
    diagonal: float = 0.0
    body: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite([self.edge, self.diagonal, self.body]).all():
            raise ModelError(
                f"stiffness = {{ edge = {self.edge}, diagonal = {self.diagonal}, body = {self.body} }}: must be finite"
            )


def check_law(law: str, rule: str | None) -> None:
    """Raise ModelError if springs by a rule of RULES, or of user-defined stiffness (None), do not have this law."""
    allowed = tuple(PAIR_LAWS) if rule is None else RULES[rule].laws
    if law in allowed:
        return
    owners = [f"rule = '{name}'" for name, other in RULES.items() if law in other.laws]
    owners += ["stiffness"] * (law in PAIR_LAWS) + ["kind = 'fem'"] * (law in LAWS)
    whose = "stiffness" if rule is None else f"rule = '{rule}'"
    raise ModelError(
        f"law = '{law}' is not available with {whose}"
        + ("" if owners else nearest(law, allowed))
        + (f"; allowed: {', '.join(allowed)}" if allowed else "; this rule has no other law")
        + (f"; available with {', '.join(owners)}" if owners else "")
    )


def require_body(problem: Problem) -> tuple[Material, Section]:
    """Return material and section; raise ModelError if the problem is a plain network."""
    if problem.material is None or problem.section is None or problem.mesh.element == "line":
        raise ModelError("a model of a body requires a mesh of elements, a material and a section")
    return problem.material, problem.section


def rule_stiffness(problem: Problem, rule: str, parameters: dict[str, Any]) -> Floats:
    """Return the stiffness of each element's links by a rule of RULES [N/m], shape (n_elements, links).

    If the mesh has several kinds of elements, rows are padded with zeros.
    """
    check_rule(problem, rule, parameters)
    if RULES[rule].coupled:
        return RULES[rule].stiffness(problem, **parameters)
    return by_kind(problem, lambda part: _of_one_kind(part, rule, parameters))


def _of_one_kind(problem: Problem, rule: str, parameters: dict[str, Any]) -> Floats:
    """Return the stiffness of links [N/m] on a mesh of one kind of elements, shape (n_elements, links)."""
    own = RULES[rule].parameters
    recipe = partial(RULES[rule].stiffness, **{name: value for name, value in parameters.items() if name in own})
    forms = problem.mesh.forms
    if not forms.few:
        return recipe(problem)
    kinds = distinct_rows((forms.of, problem.material_numbers))
    try:  # one element of each form
        return np.take(recipe(sample(problem, kinds.first)), kinds.of, axis=0)
    except ModelError:
        return recipe(problem)  # raises the error with the element numbers of the whole body


def check_rule(problem: Problem, rule: str, parameters: dict[str, Any]) -> None:
    """Raise ModelError if a rule does not support the elements of the problem or the parameters."""
    require_body(problem)
    entry = RULES[rule]
    if not entry.takes(problem.mesh):
        allowed = [name for name, other in RULES.items() if other.takes(problem.mesh)]
        raise ModelError(
            f"rule = '{rule}' supports {', '.join(entry.elements)}; allowed for this mesh of {problem.mesh.kinds} "
            f"elements: {', '.join(allowed)}"
        )
    law = {"law"} if entry.laws else set()  # of plain springs, whose stiffness need not depend on it
    idle = sorted(parameters.keys() - {*entry.parameters} - law)
    if idle:
        owners = [name for name, other in RULES.items() if set(idle) & set(other.parameters)]
        raise ModelError(f"rule = '{rule}' has no parameter {', '.join(idle)}: use it with {', '.join(owners)}")
    if "k_body" in parameters and not any(part.kind.body_diagonals for _, part in problem.mesh.blocks):
        raise ModelError("k_body requires bricks: plane elements have no body diagonals")


def user_stiffness(problem: Problem, own: UserStiffness) -> Floats:
    """Return the user-defined stiffness of each element's links [N/m], shape (n_elements, links).

    If the mesh has several kinds of elements, rows are padded with zeros.
    """
    require_body(problem)
    kinds = [part.kind for _, part in problem.mesh.blocks]
    there = {"diagonal": any(kind.diagonals for kind in kinds), "body": any(kind.body_diagonals for kind in kinds)}
    for name, value in (("diagonal", own.diagonal), ("body", own.body)):
        if value and not there[name]:
            raise ModelError(
                f"stiffness: {name} = {value:g}, but a {problem.mesh.kinds} has no such diagonals; leave it out"
            )
    return by_kind(problem, lambda part: _user_stiffness(part, own))


def _user_stiffness(problem: Problem, own: UserStiffness) -> Floats:
    """Return the user-defined stiffness on a mesh of one kind of elements [N/m], shape (n_elements, links)."""
    kind = problem.mesh.kind
    values = [own.edge] * len(kind.edges) + [own.diagonal] * len(kind.diagonals) + [own.body] * len(kind.body_diagonals)
    return np.asarray(_scale(problem)[:, None] * np.array(values))


def _scale(problem: Problem) -> Floats:
    """Return the unit of stiffness of each element [N/m], shape (n_elements,): E t in 2D, E h in 3D, h^3 its volume."""
    _, section = require_body(problem)
    size = problem.mesh.measures ** (1 / 3) if problem.mesh.dim == 3 else section.thickness
    return np.asarray(problem.of_elements(lambda material: material.young) * size)


def _classes(problem: Problem, edge: float, diagonal: float = 0.0, body: float = 0.0) -> Floats:
    """Return stiffness by class of link times `_scale` [N/m], shape (n_elements, links)."""
    return user_stiffness(problem, UserStiffness(edge, diagonal, body))


def _bricks(problem: Problem, rule: str) -> Floats:
    """Return the sides of rectangles or bricks [m], shape (n_elements, dim); raise ModelError for other shapes."""
    mesh = problem.mesh
    lengths, off = np.empty((len(mesh.elements), mesh.dim)), np.empty(len(mesh.elements))
    for part in slices(len(off), 32 * mesh.kind.n_nodes * mesh.dim):
        at = mesh.nodes[mesh.elements[part]]
        sides = at[:, [1, 3, 4][: mesh.dim]] - at[:, :1]
        own = lengths[part] = np.linalg.norm(sides, axis=2)
        directions = sides / own[:, :, None]
        skew = np.abs(np.einsum("eai,ebi->eab", directions, directions) - np.eye(mesh.dim)).max(axis=(1, 2))
        closed = at[:, :1] + np.einsum("ca,eai->eci", CORNERS[: mesh.kind.n_nodes, : mesh.dim], sides)
        open_by = np.linalg.norm(at - closed, axis=2).max(axis=1) / own.max(axis=1)
        off[part] = np.maximum(skew, open_by)
    wrong = np.flatnonzero(off > 1e-6)
    if wrong.size:
        raise ModelError(
            f"rule = '{rule}' requires {'rectangles' if mesh.dim == 2 else 'bricks'}; {wrong.size} elements have other "
            f"shapes, the first is element {wrong[0]}; allowed for any shape: {', '.join(_of_any_shape(mesh))}"
        )
    return lengths


def _of_any_shape(mesh: Mesh) -> list[str]:
    """Return the rules that support the elements of a mesh in any shape."""
    return [name for name, rule in RULES.items() if rule.takes(mesh) and not rule.shapes.keys() & mesh.element_kinds]


def _of_rectangles() -> list[str]:
    """Return the rules that support rectangles."""
    return [
        name
        for name, rule in RULES.items()
        if "quadrilateral" in rule.elements and rule.shapes.get("quadrilateral") != "square"
    ]


def lloyd(problem: Problem) -> Floats:
    """Return the stiffness [N/m], shape (n_elements, links), by the rule `lloyd`.

    Squares: edges 5/16 t E, diagonals 7/16 t E (Lembryk and Ciszkiewicz, equations 1 and 2, after Lloyd, Szekely,
    Harders 2007). Triangles: sqrt(3)/4 t E, exact for an equilateral triangle at Poisson's ratio 1/3. Tetrahedra:
    2 sqrt(2)/25 E l with l = (12 V / sqrt(2))^(1/3), the edge of a regular tetrahedron of the same volume V (Lloyd et
    al. 2007, as implemented by the bond style tetmsm of LAMMPS), exact for a regular one at Poisson's ratio 1/4.
    """
    element = problem.mesh.element
    if element == "triangle":
        return _classes(problem, np.sqrt(3) / 4)
    if element == "tetrahedron":
        return _classes(problem, 2 * np.sqrt(2) / 25 * (12 / np.sqrt(2)) ** (1 / 3))
    sides = _bricks(problem, "lloyd")
    unequal = np.abs(sides[:, 0] / sides[:, 1] - 1)
    if unequal.max() > 1e-6:
        worst = sides[int(unequal.argmax())]
        raise ModelError(
            f"rule = 'lloyd' requires squares, but an element has {worst[0]:g} m by {worst[1]:g} m: change size or "
            f"elements, or use one of the rules {', '.join(_of_rectangles())}"
        )
    return _classes(problem, 5 / 16, 7 / 16)


def isotropic(problem: Problem, k_body: float | None = None, law: str = STRAIGHT) -> Floats:
    """Return the stiffness [N/m], shape (n_elements, links), of an isotropic lattice with the E of the material.

    Its Poisson's ratio is 1/3 in plane stress and 1/4 in 3D. Squares: 3/8 t E on edges and diagonals (Brisard, "What is
    homogenization?", part 4; the only such pair). Cubes, in E h: edges 1/10 + k_body/3, face diagonals
    1/5 - 2 k_body/3, body diagonals k_body, a free parameter (the family of Golec et al. 2020), by default that of the
    force law in PAIR_LAWS. Rectangles and bricks:
    the stiffness for which C_iijj = sum k (d_i d_j)^2 / L^2 / V is isotropic, d the vector along a spring of length L:
    the diagonals of each face follow from C_iijj, then the edges from C_iiii. On rectangles this is the member for
    Poisson's ratio 1/3 of the family of Baudet et al. (2009); an edge is negative at aspect ratios above sqrt(3).
    """
    k_body = PAIR_LAWS[law].k_body if k_body is None else k_body
    if not 0 <= k_body <= _LARGEST_K_BODY:
        raise ModelError(f"k_body = {k_body:g}: allowed are values from 0 to {_LARGEST_K_BODY:g}, in E h")
    kind, dim = problem.mesh.kind, problem.mesh.dim
    sides = _bricks(problem, "isotropic")
    links = np.array(kind.links)
    along = np.abs(CORNERS[links[:, 1], :dim] - CORNERS[links[:, 0], :dim])
    squares = along * sides[:, None] ** 2
    young, size = problem.of_elements(lambda material: material.young), np.prod(sides, axis=1)
    modulus = young * size * require_body(problem)[1].thickness
    normal, mixed = (9 / 8, 3 / 8) if dim == 2 else (6 / 5, 2 / 5)
    stiffness = np.where(along.sum(axis=1) == 3, k_body * (young * size ** (1 / 3))[:, None], 0.0)

    def share(i: int, j: int) -> Floats:
        """Return the contribution of each link of unit stiffness to C_iijj V [m^2], shape (n_elements, links)."""
        return np.asarray(squares[:, :, i] * squares[:, :, j] / squares.sum(axis=2))

    pairs = [(i, j) for i in range(dim) for j in range(i)] + [(i, i) for i in range(dim)]
    for i, j in pairs:
        own = (along == np.eye(dim)[i] + (i != j) * np.eye(dim)[j]).all(axis=1)
        missing = (normal if i == j else mixed) * modulus - (stiffness * share(i, j)).sum(axis=1)
        stiffness[:, own] = (missing / share(i, j)[:, own].sum(axis=1))[:, None]
    return stiffness


def projected(problem: Problem) -> Floats:
    """Return k = -n . K_ij n [N/m], shape (n_elements, links), with the blocks K_ij of the linear FEM element matrix.

    This is the least-squares fit of the off-diagonal blocks. At Poisson's ratio 1/3 it gives Lloyd's 5/16 and 7/16 on
    squares in plane stress, and the longer formula of Van Gelder (1998) on triangles.
    """
    links = np.array(problem.mesh.kind.links)

    def fit(direction: Floats, blocks: Floats) -> Floats:
        off_diagonal = blocks[:, links[:, 0], :, links[:, 1], :].swapaxes(0, 1)
        return np.asarray(-np.einsum("eli,elij,elj->el", direction, off_diagonal, direction))

    return _fitted(problem, fit)


def least_squares(problem: Problem) -> Floats:
    """Return the stiffness [N/m], shape (n_elements, links), whose element matrix is nearest to that of linear FEM.

    The distance is the Frobenius norm of the difference.
    The matrix of a spring of unit stiffness is b b^T with b = (-n, n) at its ends; the normal equations are
    sum_t (b_s . b_t)^2 k_t = b_s . K b_s. Squares in plane stress, in t E: (6 - nu) / (21 (1 - nu^2)) on edges,
    (15 + nu) / (42 (1 - nu^2)) on diagonals; cubes at nu = 1/4, in E h: 29/350, 188/1575 and 41/525.
    """
    links = np.array(problem.mesh.kind.links)
    every = np.arange(len(links))

    def fit(direction: Floats, blocks: Floats) -> Floats:
        stencil = np.zeros((len(direction), len(links), *blocks.shape[1:3]))
        stencil[:, every, links[:, 0]], stencil[:, every, links[:, 1]] = -direction, direction
        gram = np.einsum("esai,etai->est", stencil, stencil, optimize=True) ** 2
        target = np.einsum("esai,eaibj,esbj->es", stencil, blocks, stencil, optimize=True)
        return np.asarray(np.linalg.solve(gram, target[:, :, None])[:, :, 0])

    return _fitted(problem, fit)


def van_gelder(problem: Problem) -> Floats:
    """Return E t A / L^2 of triangles, E V / L^2 of tetrahedra [N/m], shape (n_elements, links); A area, V volume.

    The simple formula of Van Gelder, Journal of Graphics Tools 3 (1998). Exact on equilateral triangles.
    """
    _, section = require_body(problem)
    young = problem.of_elements(lambda material: material.young)
    size = young * section.thickness * problem.mesh.measures
    return np.asarray(size[:, None] / (link_vectors(problem.mesh) ** 2).sum(axis=2))


def biquadratic(problem: Problem) -> Floats:
    """Return k = 8 L^2 M_ss [N/m], shape (n_elements, links), of the coupled springs W = q . M q, q = l^2 - L^2.

    They equal St. Venant-Kirchhoff finite elements: Delingette (2008) on triangles, Goulette and Chen (2015) on
    tetrahedra, the same formula between all pairs of nodes of other elements. See `link_coupling`.
    """

    def of_one_kind(part: Problem) -> Floats:
        length_squared = (link_vectors(part.mesh) ** 2).sum(axis=2)
        return np.asarray(8 * length_squared * np.einsum("ess->es", link_coupling(part)))

    return by_kind(problem, of_one_kind)


def _biquadratic_potential(problem: Problem) -> LinkedElements | SummedLinks:
    """Return the potential of biquadratic springs."""
    return summed_links(problem, BiquadraticSprings)


def _fitted(problem: Problem, fit: Callable[[Floats, Floats], Floats]) -> Floats:
    """Return the stiffness that `fit` gives for all elements, slice by slice [N/m], shape (n_elements, links).

    The arguments of `fit` are the unit vectors of the links, shape (n, links, dim), and the linear FEM matrices in
    blocks [N/m], shape (n, nodes, dim, nodes, dim).
    """
    mesh, potential = problem.mesh, fem_of_one_kind(problem, "linear")
    shape = (mesh.kind.n_nodes, mesh.dim)
    found = np.empty((len(mesh.elements), len(mesh.kind.links)))
    for part in slices(len(found), 16 * math.prod(shape) ** 2):
        across = link_vectors(mesh, part)
        matrices = potential.element_hessians(mesh.nodes, None, part.start, part.stop)
        found[part] = fit(across / np.linalg.norm(across, axis=2, keepdims=True), matrices.reshape(-1, *shape, *shape))
    return found


_ALL = ("triangle", "quadrilateral", "tetrahedron", "pyramid", "wedge", "hexahedron")

_THIRD, _QUARTER = (1 / 3, 1 / 3), (1 / 4, 1 / 4)

RULES: Table[Rule] = Table(
    "truespring.rules",
    {
        "lloyd": Rule(
            lloyd,
            ("triangle", "quadrilateral", "tetrahedron"),
            "a constant multiple of E for each kind of element",
            (
                LatticeModuli("squares", (15 / 17, 21 / 19), (5 / 19, 7 / 17)),
                LatticeModuli("equilateral triangles", poisson=_THIRD),
                LatticeModuli("body-centred-cubic tetrahedra", (127 / 126, 127 / 126), _QUARTER),
            ),
            "Lembryk and Ciszkiewicz, equations 1 and 2, after Lloyd, Szekely, Harders 2007",
            shapes=MappingProxyType({"quadrilateral": "square"}),
            laws=tuple(PAIR_LAWS),
        ),
        "isotropic": Rule(
            isotropic,
            ("quadrilateral", "hexahedron"),
            "an isotropic lattice",
            (LatticeModuli("rectangles", poisson=_THIRD), LatticeModuli("bricks", poisson=_QUARTER)),
            "Brisard, What is homogenization? part 4; Baudet et al. 2009; Golec et al. 2020",
            shapes=MappingProxyType({"quadrilateral": "rectangle", "hexahedron": "brick"}),
            parameters=("k_body", "law"),
            laws=tuple(PAIR_LAWS),
        ),
        "least-squares": Rule(
            least_squares,
            _ALL,
            "least-squares fit to all entries of the FEM element matrix",
            (
                LatticeModuli("squares", (340 / 399, 460 / 441), (17 / 63, 23 / 57), at=1 / 3),
                LatticeModuli("equilateral triangles", poisson=_THIRD, at=1 / 3),
                LatticeModuli("cubes", (0.7258, 0.8469), (0.2351, 0.2730), at=1 / 4),
                LatticeModuli("body-centred-cubic tetrahedra", (0.6337, 1.1715), (0.1982, 0.3367), at=1 / 4),
                LatticeModuli("wedges", (0.2433, 1.0396), (0.1108, 0.5308), at=1 / 4),
                LatticeModuli("pyramids", (0.3987, 1.1040), (0.1749, 0.3826), at=1 / 4),
            ),
            "the norm of Lloyd et al. 2007 for tetrahedra, applied to every element",
        ),
        "projected": Rule(
            projected,
            _ALL,
            "least-squares fit to the off-diagonal blocks of the FEM element matrix",
            (
                LatticeModuli("squares", (15 / 17, 21 / 19), (5 / 19, 7 / 17), at=1 / 3),
                LatticeModuli("equilateral triangles", poisson=_THIRD, at=1 / 3),
                LatticeModuli("cubes", (0.8325, 1.1057), (0.2236, 0.2919), at=1 / 4),
                LatticeModuli("body-centred-cubic tetrahedra", (12 / 17, 33 / 28), (23 / 112, 11 / 34), at=1 / 4),
                LatticeModuli("wedges", (0.3202, 1.2490), (0.1151, 0.5515), at=1 / 4),
                LatticeModuli("pyramids", (3 / 5, 21 / 17), (13 / 68, 7 / 20), at=1 / 4),
            ),
            "after Lloyd et al. 2007; the longer formula of Van Gelder 1998 on triangles",
        ),
        "van-gelder": Rule(
            van_gelder,
            ("triangle", "tetrahedron"),
            "E area / length^2 and E volume / length^2",
            (
                LatticeModuli("equilateral triangles", poisson=_THIRD),
                LatticeModuli("body-centred-cubic tetrahedra", (6 / 7, 12 / 11), (5 / 22, 2 / 7)),
            ),
            "Van Gelder, Journal of Graphics Tools 3, 1998",
        ),
        "biquadratic": Rule(
            biquadratic,
            _ALL,
            "springs in squared lengths, coupled within an element: equal to St. Venant-Kirchhoff finite elements",
            (LatticeModuli(ANY_MESH),),
            "Delingette 2008 (triangles), Goulette and Chen 2015 (tetrahedra)",
            potential=_biquadratic_potential,
            locks_on=_ALL,
            remark=(
                "coupled springs cost more than plain ones; their law is St. Venant-Kirchhoff, which softens in "
                "compression and differs from other laws, such as neo-Hookean, above strains of a few percent"
            ),
        ),
        "gaussian": Rule(
            gaussian_stiffness,
            _ALL,
            "springs of zero rest length and a pressure in each element: the neo-Hookean law",
            (LatticeModuli(ANY_MESH),),
            "James and Guth 1943 (Gaussian chains); Pinkall and Polthier 1993 (weights on triangles)",
            parameters=("hourglass", "element", "law"),
            potential=gaussian_potential,
            laws=GAUSSIAN_LAWS,
            locks_on=SIMPLICES,
            takes_fibres=True,
        ),
    },
    Rule,
)
