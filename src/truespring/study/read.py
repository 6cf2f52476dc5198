"""Read and check a study file, and build the objects of the Python API from it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from truespring.errors import FibreError, LoadError, NoLoadError, PartError, StudyError, ToolError, TruespringError
from truespring.material import SECTIONS, Section
from truespring.mesh import Mesh
from truespring.models import SpringNetwork, check_fibres
from truespring.problem import Problem
from truespring.showing.values import card_of
from truespring.study.case import Case
from truespring.study.changes import changed
from truespring.study.faults import fault_lines
from truespring.study.parsing import parse
from truespring.study.places import Places
from truespring.study.schema import Scope, StudyKeys, key_of_tool


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Study(Case):
    """A study file as objects, checked as far as possible without solving: see `read_study`.

    Attributes, besides those of a case (title, problem, solver, entries, model, references, probe, tolerance, refine):
        text: the file and its TOML, including changed values.
        keys: the checked values in SI units with all defaults; `elements` counts those of the refined mesh.
        halvings: how often the element size of the file was halved.

    Example:
        >>> import truespring as ts
        >>> study = ts.read_study(ts.new("strip", "strip.toml"), **{"mesh.elements": [4, 1], "solver.load_steps": 2})
        >>> study.problem.mesh.n_nodes, list(study.entries), study.references
        (10, ['springs', 'linear', 'neo-hookean'], ('linear', 'neo-hookean'))
    """

    text: "StudyText"
    keys: StudyKeys
    halvings: int

    def __repr__(self) -> str:
        mesh = self.problem.mesh
        return f"Study({str(self.file)!r}, {mesh.n_nodes} nodes, models: {', '.join(self.entries)})"

    def _repr_html_(self) -> str:
        """Return the study as HTML for a notebook: a table and a picture."""
        models = [(f"model {name}", entry.label_on(self.problem)) for name, entry in self.entries.items()]
        own = card_of(self.problem)
        return replace(own, title=f"Study: {self.title}", rows=[*own.rows, *models]).html()

    @property
    def file(self) -> Path:
        """Path of the study file as the user gave it."""
        return self.text.file

    @property
    def source(self) -> str:
        """Text of the study file."""
        return self.text.source

    def finer(self, halvings: int = 1) -> "Study":
        """Return the study with the element size halved `halvings` times; raise StudyError if that fails."""
        return self.text.study(halvings=self.halvings + halvings)


@dataclass(frozen=True)
class StudyText:
    """A study file that is parsed but not yet checked; builds studies with the values of the file or with others.

    Attributes:
        file, source: path as the user gave it, and text of the file.
        document: the parsed TOML, including changed values.
    """

    file: Path
    source: str
    document: Mapping[str, Any]

    @cached_property
    def places(self) -> Places:
        """Line numbers of the keys."""
        return Places(self.file, self.source)

    def changed(self, changes: Mapping[str, Any]) -> "StudyText":
        """Return a copy with other values by dotted key, such as {"load.1.force": [0, 1]}; raise StudyError."""
        try:
            return replace(self, document=changed(self.document, changes))
        except StudyError as error:
            raise StudyError(f"{self.file}: {error}") from None

    def keys(self, changes: Mapping[str, Any] | None = None) -> StudyKeys:
        """Return the checked values in SI units, with `changes` by dotted key; raise StudyError with all errors."""
        text = self.changed(changes) if changes else self
        try:
            return StudyKeys.model_validate(text.document)
        except ValidationError as error:
            raise StudyError("\n".join(fault_lines(self.places, error))) from None

    def study(self, changes: Mapping[str, Any] | None = None, halvings: int = 0, balanced: bool = True) -> Study:
        """Return the study, checked as far as possible without solving; raise StudyError with all errors.

        Args:
            changes: other values by dotted key, see `read_study`.
            halvings: how often to halve the element size.
            balanced: whether loads and supports have to define an equilibrium; natural frequencies need neither.
        """
        text = self.changed(changes) if changes else self
        keys = text.keys()
        keys = keys.model_copy(update={"mesh": keys.mesh.finer(halvings)}) if halvings else keys
        return _build(text, keys, halvings, balanced)


def read_text(file: str | Path) -> StudyText:
    """Read and parse a study file; raise StudyError if it cannot be read or is not valid TOML."""
    return StudyText(Path(file), *parse(Path(file)))


def read_study(file: str | Path, /, **changes: Any) -> Study:
    """Read and check a study file, with other values for some of its keys.

    Args:
        file: path of the study.
        **changes: other values by dotted key; lists count from 1. Numbers are in SI units, strings have a unit.

    Raises StudyError with file, line, key, value, what is allowed and the nearest key.

    Example:
        >>> import truespring as ts
        >>> file = ts.new("strip", "strip.toml")
        >>> study = ts.read_study(file, **{"material.poisson": 0.4, "material.young": "8 kPa"})
        >>> study.problem.material.young, study.problem.material.poisson
        (8000.0, 0.4)
    """
    return read_text(file).study(changes)


# --- from keys to objects -----------------------------------------------------------------------------


def _build(text: StudyText, keys: StudyKeys, halvings: int, balanced: bool) -> Study:
    places = text.places
    problem, network = _problem(keys, places, halvings, balanced)
    solver = keys.solver.build(places, problem)
    entries = {}
    for name, model_keys in keys.models.items():
        with places.at("models", name):
            scope = Scope(places, problem, solver, network, keys.models, name)
            entries[name] = model_keys.build(scope)
            check_fibres(problem, entries[name])
            model_keys.check(scope, entries[name])
    model, references = keys.compare.names(places, entries)
    return Study(
        title=keys.title or text.file.stem,
        text=text,
        keys=keys,
        halvings=halvings,
        problem=problem,
        solver=solver,
        entries=entries,
        model=model,
        references=references,
        probe=keys.compare.node(places, problem.mesh),
        tolerance=keys.compare.tolerance,
        refine=keys.compare.refine,
        form=keys.output.build(places),
    )


def _problem(keys: StudyKeys, places: Places, halvings: int, balanced: bool) -> tuple[Problem, SpringNetwork | None]:
    """Return the problem, and the spring network if the mesh is one, else None."""
    with places.at("mesh"):
        read = keys.mesh.build(places, halvings)
    network = read if isinstance(read, SpringNetwork) else None
    mesh = read.mesh if isinstance(read, SpringNetwork) else read
    with places.at("material"):
        if keys.material is None and network is None:
            raise StudyError("is required and missing")
        material = None if keys.material is None else keys.material.build(mesh.dim)
    section = None if network else _section(keys, places, mesh)
    regions = []
    for number, region in enumerate(keys.region):
        with places.at("region", number):
            regions.append(region.region(mesh))
    supports = [support.build(places, number, mesh) for number, support in enumerate(keys.support)]
    loads = [load.build(places, number, mesh) for number, load in enumerate(keys.load)]
    moves = keys.dynamics is not None
    tools = [tool.build(places, number, mesh, moves) for number, tool in enumerate(keys.tool)]
    grasps = [grasp.build(places, number, mesh, moves) for number, grasp in enumerate(keys.grasp)]
    dynamics = None if keys.dynamics is None else keys.dynamics.build(places)
    if dynamics is not None and network is not None and not network.mass.size:
        with places.at("mesh", "nodes"):
            raise StudyError("a motion needs the mass of the nodes: add a column mass [kg] to the file")
    _check_histories(keys, places)
    moving: dict[str, Any] = {"dynamics": dynamics, "tools": tools, "grasps": grasps}
    try:
        return Problem(mesh, material, section, supports, loads, regions, stated=balanced, **moving), network
    except FibreError as error:
        own = [number for number, region in enumerate(regions) if region.material.fibres == error.fibres]
        with places.at("region", own[0]) if own else places.at("material"):
            raise
    except PartError as error:
        with places.at(*error.place):
            raise StudyError(error.text) from None
    except LoadError as error:
        with places.at("load", error.number):
            raise StudyError(error.text) from None
    except ToolError as error:
        with places.at(*key_of_tool(error.name, error.key, {"tool": tools, "grasp": grasps})):
            raise StudyError(error.text) from None
    except TruespringError as error:
        with places.at("load" if isinstance(error, NoLoadError) else "support"):
            raise


def _check_histories(keys: StudyKeys, places: Places) -> None:
    """Raise StudyError for a history over times without a motion."""
    for kind, several in (("load", [one.over for one in keys.load]), ("support", [one.over for one in keys.support])):
        for number, over in enumerate(several):
            if keys.dynamics is None and over is not None and over.timed:
                with places.at(kind, number, "over"):
                    raise StudyError("times need [dynamics]: at rest the first column is a share of the way, 0 to 1")


def _section(keys: StudyKeys, places: Places, mesh: Mesh) -> Section | None:
    """Return the section of a plane body, None for a body in 3D."""
    with places.at("section"):
        if mesh.dim == 3 and keys.section is not None:
            raise StudyError("is for plane bodies only: leave it out in 3D")
        if mesh.dim == 3:
            return None
        if keys.section is None:
            raise StudyError(f"is required and missing; kind: {', '.join(SECTIONS)}, and a thickness")
        return keys.section.build()
