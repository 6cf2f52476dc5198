"""The body of a map: on any mesh that an axis asks for, under any load type, of any Poisson's ratio."""

from dataclasses import dataclass, replace

from truespring.errors import StudyError
from truespring.mesh import Mesh, box, nearest_node, rectangle, refined, refuse_too_large
from truespring.models import Fem
from truespring.problem import Problem
from truespring.study import Study, schema
from truespring.validity.loads import LOAD_TYPES, Asked, Bar, LoadType

# Element counts off a whole number by less are whole.
_WHOLE = 1e-6


@dataclass(frozen=True, slots=True)
class Spot:
    """A mesh and a material: `depth` elements through the depth, `aspect` their length over height, Poisson's ratio.

    What is None is the study's own.
    """

    depth: int | None = None
    aspect: float | None = None
    poisson: float | None = None


@dataclass(frozen=True, eq=False)
class Body:
    """What is mapped.

    Attributes:
        problem: the study's own, on its own mesh.
        shape: the rectangle or box as the study has it, None for a mesh that was read.
        probe: where the study's own probe is [m], None where it has none.
    """

    problem: Problem
    shape: schema.ShapeKeys | None
    probe: tuple[float, ...] | None

    @staticmethod
    def of(study: Study) -> "Body":
        """Return the body of a study; raise StudyError where it is none of elements."""
        keys = study.keys.mesh
        shape = keys if isinstance(keys, schema.ShapeKeys) and keys.is_bar else None
        problem = study.problem
        if problem.material is None or problem.mesh.element == "line":
            raise StudyError(f"{study.file}: a plain network has no material: there is no FEM to map it against")
        probe = None if study.probe is None else tuple(problem.mesh.nodes[study.probe].tolist())
        return Body(problem, shape, probe)

    @property
    def dim(self) -> int:
        """The number of directions."""
        return self.problem.mesh.dim

    @property
    def extent(self) -> tuple[float, ...]:
        """The sides of the body [m]."""
        mesh = self.problem.mesh
        return tuple(float(side) for side in mesh.upper - mesh.lower)

    @property
    def depth(self) -> int:
        """Elements through the depth of the study's own mesh, 0 for a mesh that was read."""
        return 0 if self.shape is None else self.shape.elements[1]

    @property
    def aspect(self) -> float:
        """Length over height of the study's own elements, 1 for a mesh that was read."""
        if self.shape is None:
            return 1.0
        (length, height), (n_x, n_y) = self.extent[:2], self.shape.elements[:2]
        return length / n_x / (height / n_y)

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the body's own material."""
        material = self.problem.material
        assert material is not None  # `of` has asked for it
        return material.poisson

    def counts(self, depth: int, aspect: float) -> tuple[tuple[int, ...], bool]:
        """Return the elements along each direction, and whether all are whole without being rounded."""
        length, height, *width = self.extent
        wanted = [length * depth / height / aspect, depth, *(side * depth / height for side in width)]
        found = tuple(max(1, round(count)) for count in wanted)
        return found, max(abs(count - one) for count, one in zip(wanted, found, strict=True)) <= _WHOLE * max(wanted)

    def mesh(self, spot: Spot) -> Mesh:
        """Return the mesh of the springs."""
        shape = self.shape
        if shape is None or (spot.depth is None and spot.aspect is None):
            return self.problem.mesh
        counts, _ = self.counts(spot.depth or self.depth, self.aspect if spot.aspect is None else spot.aspect)
        return shape.divided(counts)

    def springs_problem(self, load: LoadType, factor: float, spot: Spot) -> Problem:
        """Return the problem of the springs at a share of the load."""
        return self._loaded(self.mesh(spot), load, factor, spot.poisson)

    def reference_problem(self, load: LoadType, factor: float, poisson: float | None, level: int) -> Problem:
        """Return that of the reference on the mesh of a level, each of elements half as large as on the one before."""
        return self._loaded(self._reference_mesh(level), load, factor, poisson)

    def _reference_mesh(self, level: int) -> Mesh:
        """Triangles and tetrahedra, about as long as high; of a mesh that was read, itself divided."""
        if self.shape is None:
            mesh = self.problem.mesh
            for _ in range(level):
                refuse_too_large(2**mesh.dim * mesh.n_nodes, mesh.dim)
                mesh = refined(mesh)
            return mesh
        counts, _ = self.counts(2**level * (2 if self.dim == 2 else 1), 1.0)
        if self.dim == 2:
            return rectangle(self.shape.size, counts, "triangle", "alternating")
        return box(self.shape.size, counts, "tetrahedron")

    def reference_model(self, law: str) -> Fem:
        """Return finite elements that do not lock: of second order on triangles and tetrahedra, the default there."""
        return Fem(law)

    def asked(self, load: LoadType) -> Asked:
        """Return supports and loads of a standard type on this body, and its probe."""
        problem, material = self.problem, self.problem.material
        assert material is not None and problem.section is not None  # `of` has asked for them
        modulus, _ = problem.section.apparent_moduli(material)
        assert load.standard is not None  # own loads are the study's
        return load.standard(Bar(self.extent, problem.section.thickness, modulus))

    def probe_in(self, problem: Problem, load: LoadType) -> int | None:
        """Return the number of the probe's node, None where it is the one that moves most."""
        place = self.probe if load.own else self.asked(load).probe
        return None if place is None else nearest_node(problem.mesh, list(place))

    def _loaded(self, mesh: Mesh, load: LoadType, factor: float, poisson: float | None) -> Problem:
        given = self.problem
        if poisson is not None:
            assert given.material is not None  # `of` has asked for it
            regions = [replace(one, material=replace(one.material, poisson=poisson)) for one in given.regions]
            given = replace(given, material=replace(given.material, poisson=poisson), regions=regions)
        if not load.own:
            asked = self.asked(load)
            given = replace(given, supports=asked.supports, loads=asked.loads)
        return (replace(given, mesh=mesh) if mesh is not given.mesh else given).scaled(factor)

    def refuse(self, load: str) -> LoadType:
        """Return a load type by name; raise StudyError where it is not for this body."""
        known = LOAD_TYPES[load]
        if self.shape is None and not known.own:
            raise StudyError(
                f"load {load}: standard loads are made for rectangles and boxes; a mesh from a file is mapped under "
                "the study's own load only: --load own"
            )
        if self.dim not in known.dims:
            raise StudyError(f"load {load}: is for bodies in space, this one is plane")
        return known
