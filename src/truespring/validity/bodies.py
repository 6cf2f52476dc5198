"""The body of a map with any mesh, load type and Poisson's ratio of its axes."""

from dataclasses import dataclass, replace

from truespring.errors import StudyError
from truespring.mesh import Mesh, box, nearest_node, rectangle, refined, refuse_too_large
from truespring.models import Fem
from truespring.problem import Problem
from truespring.study import Study, schema
from truespring.validity.loads import LOAD_TYPES, Bar, LoadType, StandardLoad

# Tolerance of element counts that are integers.
_WHOLE = 1e-6


@dataclass(frozen=True, slots=True)
class Spot:
    """A point of a map: mesh and material; None is the value of the study.

    Attributes:
        depth: number of elements through the depth.
        aspect: length over height of the elements.
        poisson: Poisson's ratio.
    """

    depth: int | None = None
    aspect: float | None = None
    poisson: float | None = None


@dataclass(frozen=True, eq=False)
class Body:
    """The body of a map.

    Attributes:
        problem: that of the study.
        shape: rectangle or box of the study; None for a mesh from a file.
        probe: probe of the study [m]; None without one.
    """

    problem: Problem
    shape: schema.ShapeKeys | None
    probe: tuple[float, ...] | None

    @staticmethod
    def of(study: Study) -> "Body":
        """Return the body of a study; raise StudyError if it has no elements."""
        keys = study.keys.mesh
        shape = keys if isinstance(keys, schema.ShapeKeys) and keys.is_bar else None
        problem = study.problem
        if problem.material is None or problem.mesh.element == "line":
            raise StudyError(f"{study.file}: a plain network has no material and no FEM to compare with")
        probe = None if study.probe is None else tuple(problem.mesh.nodes[study.probe].tolist())
        return Body(problem, shape, probe)

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return self.problem.mesh.dim

    @property
    def extent(self) -> tuple[float, ...]:
        """Lengths of the sides of the body [m]."""
        mesh = self.problem.mesh
        return tuple(float(side) for side in mesh.upper - mesh.lower)

    @property
    def depth(self) -> int:
        """Number of elements through the depth of the study's mesh; 0 for a mesh from a file."""
        return 0 if self.shape is None else self.shape.elements[1]

    @property
    def aspect(self) -> float:
        """Length over height of the study's elements; 1 for a mesh from a file."""
        if self.shape is None:
            return 1.0
        (length, height), (n_x, n_y) = self.extent[:2], self.shape.elements[:2]
        return length / n_x / (height / n_y)

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the study's material."""
        material = self.problem.material
        assert material is not None  # checked by `of`
        return material.poisson

    def counts(self, depth: int, aspect: float) -> tuple[tuple[int, ...], bool]:
        """Return the number of elements along each side, and whether they are integers without rounding."""
        length, height, *width = self.extent
        exact = [length * depth / height / aspect, depth, *(side * depth / height for side in width)]
        found = tuple(max(1, round(count)) for count in exact)
        return found, max(abs(count - one) for count, one in zip(exact, found, strict=True)) <= _WHOLE * max(exact)

    def mesh(self, spot: Spot) -> Mesh:
        """Return the mesh of the springs."""
        shape = self.shape
        if shape is None or (spot.depth is None and spot.aspect is None):
            return self.problem.mesh
        counts, _ = self.counts(spot.depth or self.depth, self.aspect if spot.aspect is None else spot.aspect)
        return shape.divided(counts)

    def springs_problem(self, load: LoadType, factor: float, spot: Spot) -> Problem:
        """Return the problem of the springs under a factor times the load."""
        return self._loaded(self.mesh(spot), load, factor, spot.poisson)

    def reference_problem(self, load: LoadType, factor: float, poisson: float | None, level: int) -> Problem:
        """Return the problem of the reference on the mesh of a level; each level halves the elements."""
        return self._loaded(self._reference_mesh(level), load, factor, poisson)

    def _reference_mesh(self, level: int) -> Mesh:
        """Return triangles or tetrahedra, about as long as high; a mesh from a file is refined."""
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
        """Return finite elements that do not lock: second order on triangles and tetrahedra, the default there."""
        return Fem(law)

    def standard_load(self, load: LoadType) -> StandardLoad:
        """Return supports, loads and probe of a standard load type on this body."""
        problem, material = self.problem, self.problem.material
        assert material is not None and problem.section is not None  # checked by `of`
        modulus, _ = problem.section.apparent_moduli(material)
        assert load.standard is not None  # not the load of the study
        return load.standard(Bar(self.extent, problem.section.thickness, modulus))

    def probe_in(self, problem: Problem, load: LoadType) -> int | None:
        """Return the node number of the probe; None for the node that moves most."""
        place = self.probe if load.own else self.standard_load(load).probe
        return None if place is None else nearest_node(problem.mesh, list(place))

    def _loaded(self, mesh: Mesh, load: LoadType, factor: float, poisson: float | None) -> Problem:
        problem = self.problem
        if poisson is not None:
            assert problem.material is not None  # checked by `of`
            regions = [replace(one, material=replace(one.material, poisson=poisson)) for one in problem.regions]
            problem = replace(problem, material=replace(problem.material, poisson=poisson), regions=regions)
        if not load.own:
            standard = self.standard_load(load)
            problem = replace(problem, supports=standard.supports, loads=standard.loads)
        return (replace(problem, mesh=mesh) if mesh is not problem.mesh else problem).scaled(factor)

    def load_type(self, load: str) -> LoadType:
        """Return a load type by name; raise StudyError if it is not for this body."""
        known = LOAD_TYPES[load]
        if self.shape is None and not known.own:
            raise StudyError(
                f"load {load}: standard loads need a rectangle or a box; a mesh from a file takes the load of the "
                "study only: --load own"
            )
        if self.dim not in known.dims:
            raise StudyError(f"load {load} needs a body in 3D, this one is plane")
        return known
