"""Keys of a whole study file, of `[solver]` and of `[compare]`."""

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from truespring.dynamics import Damping, Dynamics
from truespring.equilibrium import check_solver
from truespring.errors import StudyError
from truespring.mesh import Mesh, named_point, nearest_node, select
from truespring.models import Model
from truespring.problem import Problem
from truespring.report.series import Form
from truespring.solvers import ArcLength, DisplacementControl, Newton, Solver
from truespring.study.case import compared_model, reference_names
from truespring.study.places import Places
from truespring.study.schema.body import AnyLoad, MaterialKeys, RegionKeys, SectionKeys, SupportKeys
from truespring.study.schema.meshes import AnyMesh
from truespring.study.schema.models import AnyModel, ModelKeys
from truespring.study.schema.tools import GraspKeys, ToolKeys
from truespring.study.schema.values import (
    Direction,
    Keys,
    Length,
    Number,
    On,
    Probe,
    Rate,
    Speed,
    Step,
    Time,
    two_or_three,
)


class SolverKeys(Keys):
    """How equilibrium is found."""

    load_steps: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=10, description="number of load levels between no load and full load"
    )
    control: Literal["load", "displacement", "arc-length"] = Field(
        default="load",
        description="what is prescribed at each step: the load, a displacement, or the arc length of the path",
    )
    on: On = Field(
        default=None, description="with control by displacement: the nodes whose mean displacement is prescribed"
    )
    direction: Direction | None = Field(
        default=None, description="with control by displacement: the direction of that displacement"
    )
    to: Length | None = Field(
        default=None, description="with control by displacement: the displacement at the end of the path"
    )
    max_steps: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=200, description="with control by arc length: largest number of steps"
    )
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = Field(
        default=1e-10,
        description="unbalanced force over the larger of applied and internal force at which a level is solved",
    )
    max_iterations: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=50, description="largest number of Newton iterations per load level, before the step is reduced"
    )
    method: Literal["auto", "mixed", "line-search"] = Field(
        default="auto",
        description="Newton's method with mixed integration points, with a line search, or one after the other",
    )
    linear: Literal["auto", "direct", "multigrid", "pardiso", "petsc", "rslab", "scipy"] = Field(
        default="auto",
        description="solver of linear systems: by size; direct, multigrid, petsc; or a library that factorises",
    )
    coarse_start: bool = Field(
        default=True,
        description="with control by load: whether large load steps on large regular meshes start from coarser meshes",
    )

    def build(self, places: Places, problem: Problem) -> Solver:
        """Return the solver; raise StudyError if it does not fit the problem."""
        common: dict[str, Any] = {"tolerance": self.tolerance, "max_iterations": self.max_iterations}
        past = {**common, "linear": "direct" if self.linear == "auto" else self.linear}
        self._check_control(places, problem.dynamics is not None)
        if self.direction is not None and self.to is not None:
            with places.at("solver", "on"):
                select(problem.mesh, self.on)
            with places.at("solver"):
                control = DisplacementControl(self.on, self.direction, self.to, self.load_steps, **past)
                check_solver(problem, control)
                return control
        with places.at("solver", "linear"):
            if self.control == "arc-length":
                return ArcLength(self.load_steps, self.max_steps, **past)
            common |= {"method": self.method, "linear": self.linear, "coarse_start": self.coarse_start}
            return Newton(self.load_steps, **common)

    def _check_control(self, places: Places, moves: bool) -> None:
        """Raise StudyError if the control is not for motions, or keys of displacement control do not belong to it."""
        if moves and self.control != "load":
            with places.at("solver", "control"):
                raise StudyError(f'"{self.control}" is for equilibria: with [dynamics] leave control out')
        for key in ("on", "direction", "to"):
            is_set = getattr(self, key) is not None
            if is_set != (self.control == "displacement"):
                with places.at("solver", key):
                    fault = "is only" if is_set else "is required and missing"
                    raise StudyError(f'{fault} for control = "displacement"')


class DampingKeys(Keys):
    """Damping of a motion."""

    stiffness: Time = Field(
        default=0.0, description="damping by the material: viscosity over stiffness, the same for all models"
    )
    mass: Rate = Field(default=0.0, description="damping by the surroundings: force against the velocity, over mass")


class DynamicsKeys(Keys):
    """A motion in time, instead of equilibrium."""

    duration: Time = Field(description='time of the motion: a number in s, or a string with its unit such as "20 ms"')
    step: Step = Field(default="auto", description='time step; "auto" chooses each step by an estimate of its error')
    scheme: Literal["auto", "euler", "bdf2", "midpoint", "leapfrog"] = Field(
        default="auto",
        description="time integration; auto: leapfrog, which is explicit, where its stable step is long, else bdf2",
    )
    damping: DampingKeys = Field(default=DampingKeys(), description="damping: stiffness and mass")
    start: Literal["rest", "equilibrium"] = Field(
        default="rest", description="the undeformed body, or the equilibrium under the loads of time 0"
    )
    velocity: Annotated[list[Speed], two_or_three] | None = Field(
        default=None, description="velocity of the whole body at time 0; default: none"
    )
    iterations: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="Newton iterations of each step, as in real time; 0: until it is solved"
    )
    record: Time | None = Field(
        default=None, description="time between recorded states; default: a hundredth of the duration"
    )
    accuracy: Annotated[Number, Field(gt=0, lt=1)] = Field(
        default=1e-4, description='with step = "auto": error of a step over the largest displacement'
    )
    creep: Speed | None = Field(
        default=None, description="speed at which friction is full; default: 0.001 sqrt(g L), L the size of the body"
    )

    def build(self, places: Places) -> Dynamics:
        """Return what is asked of the motion; raise StudyError for values that are not allowed."""
        values = {name: getattr(self, name) for name in type(self).model_fields if name != "damping"}
        with places.at("dynamics", "damping"):
            damping = Damping(self.damping.stiffness, self.damping.mass)
        if self.scheme == "leapfrog" and self.iterations:
            with places.at("dynamics", "iterations"):
                raise StudyError("leapfrog has no iterations: leave iterations out, or choose an implicit scheme")
        with places.at("dynamics"):
            return Dynamics(damping=damping, **values)


class CompareKeys(Keys):
    """Which models are compared, and at which node."""

    model: str | None = Field(
        default=None, description="name of the model that is compared with the others; default: the first springs"
    )
    references: list[str] | None = Field(
        default=None, description="names of the models that it is compared with; default: all others"
    )
    probe: Probe = Field(
        default=None,
        description='node that the curves follow: "right-middle", or coordinates; default: the node that moves most',
    )
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = Field(
        default=0.05, description="largest error at which two models agree"
    )
    refine: bool = Field(
        default=True,
        description="whether each reference is also solved on a finer mesh, to estimate its discretisation error",
    )

    def node(self, places: Places, mesh: Mesh) -> int | None:
        """Return the node number of the probe, None for the node that moves most."""
        with places.at("compare", "probe"):
            if self.probe is None:
                return None
            return named_point(mesh, self.probe) if isinstance(self.probe, str) else nearest_node(mesh, self.probe)

    def names(self, places: Places, models: Mapping[str, Model]) -> tuple[str, tuple[str, ...]]:
        """Return the name of the compared model, by default the first springs, and those of its references."""
        with places.at("compare", "model"):
            compared = compared_model(models, self.model)
        with places.at("compare", "references"):
            return compared, reference_names(models, compared, self.references)


class OutputKeys(Keys):
    """Which files are written."""

    form: Form = Field(
        default="vtu",
        description="files of the levels: vtu, a .pvd and a .vtu for each level; or vtkhdf, one HDF5 file, for large "
        "bodies",
    )

    def build(self, places: Places) -> Form:
        """Return the form; raise StudyError if the library that writes it is not installed."""
        if self.form == "vtkhdf" and find_spec("h5py") is None:
            with places.at("output", "form"):
                raise StudyError('"vtkhdf" needs h5py: pip install \'truespring[vtkhdf]\', or use "vtu"')
        return self.form


ModelName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]


class StudyKeys(Keys):
    """A study file."""

    title: str | None = Field(default=None, description="title of the report; default: the file's name")
    mesh: AnyMesh = Field(description="the body: a shape, a mesh file, a label image or a network")
    material: MaterialKeys | None = Field(default=None, description="material of the body")
    region: list[RegionKeys] = Field(
        default=[], description="parts of another material; where regions overlap, the last one applies"
    )
    section: SectionKeys | None = Field(default=None, description="section of a plane body; absent in 3D")
    support: list[SupportKeys] = Field(
        default=[], description="supports, which at rest together prevent rigid-body motion"
    )
    load: list[AnyLoad] = Field(
        default=[], description="loads; load_factor scales all of them, linearly, unless they have a history (over)"
    )
    tool: list[ToolKeys] = Field(default=[], description="rigid bodies that move and touch the body")
    grasp: list[GraspKeys] = Field(default=[], description="patches held by springs to a place that moves")
    dynamics: DynamicsKeys | None = Field(default=None, description="a motion in time, instead of equilibrium")
    solver: SolverKeys = Field(default=SolverKeys(), description="how equilibrium is found")
    models: Annotated[dict[ModelName, AnyModel], Field(min_length=1)] = Field(
        description="models to solve, by names of your choice"
    )
    compare: CompareKeys = Field(default=CompareKeys(), description="which models are compared, and where")
    output: OutputKeys = Field(default=OutputKeys(), description="which files are written")

    @field_validator("models")
    @classmethod
    def _names_of_files(cls, models: dict[str, ModelKeys]) -> dict[str, ModelKeys]:
        """Reject names that cannot be file names on all systems: equal up to case, or reserved."""
        seen: set[str] = set()
        for name in models:
            if name.casefold() in seen | _TAKEN_NAMES:
                raise ValueError(f"'{name}' names the same file as another name on some systems: choose another name")
            seen.add(name.casefold())
        return models


_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(1, 10))}
_TAKEN_NAMES = {"figures"} | _DEVICES
