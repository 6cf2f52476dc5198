"""From a study file to the objects of the Python API, and from its faults to one readable message."""

import io
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from truespring.equilibrium import check_solver
from truespring.errors import LoadError, NoLoadError, StudyError, TruespringError, close_words, nearest, one_line, shown
from truespring.loading import LOADS, Fixed
from truespring.material import SECTIONS, Material, Section
from truespring.mesh import (
    Mesh,
    box,
    named_point,
    nearest_node,
    read_mesh,
    read_voxels,
    rectangle,
    refined,
    refuse_too_large,
    select,
    select_elements,
)
from truespring.models import (
    BemSprings,
    Fem,
    GivenSprings,
    Heml,
    MassTensor,
    Model,
    SpringNetwork,
    Springs,
    Terzopoulos,
    UserStiffness,
    material_constants,
)
from truespring.opening import read_file
from truespring.problem import Problem, Region
from truespring.program import ReadSolution
from truespring.reference import CalculiX, read_stl
from truespring.solvers import ArcLength, DisplacementControl, Newton, Solver
from truespring.study import schema
from truespring.study.changes import changed
from truespring.study.given import read_given
from truespring.study.network import read_network
from truespring.units import unit_size


@dataclass(frozen=True, eq=False)
class Study:
    """A study file as objects, checked as far as can be without solving.

    Attributes:
        title: the study's own.
        text: what it was read from, its tables with the changes that were made.
        table: its checked values in SI, all defaults filled in; elements are counted as fine as the mesh is.
        halvings: how often the mesh was made finer than the tables tell.
        problem, solver: what is asked and how it is solved.
        entries: the models by name: solved here, by another program, or read from a file (ReadSolution).
        model: the name of the entry that is compared with the others, None where there is nothing to compare.
        references: the names that it is compared with.
        probe: number of the node that is watched; None takes the one that moves most.
        tolerance: the error, rms or of force, up to which two paths agree.
        refine: whether references are refined to tell how far they are themselves off.
    """

    title: str
    text: "StudyText"
    table: schema.StudyTable
    halvings: int
    problem: Problem
    solver: Solver
    entries: Mapping[str, Model]
    model: str
    references: tuple[str, ...]
    probe: int | None
    tolerance: float
    refine: bool = True

    @property
    def file(self) -> Path:
        """The study's file, as it was named."""
        return self.text.file

    @property
    def source(self) -> str:
        """The text of the file."""
        return self.text.source

    def finer(self, halvings: int = 1) -> "Study":
        """Return this study on a mesh of half the size, so many times, from what was read; raise StudyError."""
        return self.text.study(halvings=self.halvings + halvings)

    @property
    def stem(self) -> str:
        """The file's name without its suffix; names the output folder."""
        return self.file.stem


@dataclass(frozen=True)
class StudyText:
    """A study file as it stands: what studies are made of, as it is or with other values.

    Attributes:
        file, source: the file as it was named, and its text.
        tables: the text as TOML has it, and what was changed in it, not yet checked.
    """

    file: Path
    source: str
    tables: Mapping[str, Any]

    def changed(self, changes: Mapping[str, Any]) -> "StudyText":
        """Return it with other values by key, such as {"load.1.force": [0, 1]}; raise StudyError."""
        try:
            return replace(self, tables=changed(self.tables, changes))
        except StudyError as error:
            raise StudyError(f"{self.file}: {error}") from None

    def table(self, changes: Mapping[str, Any] | None = None) -> schema.StudyTable:
        """Return the tables, checked, with other values by key if wanted; raise StudyError."""
        text = self.changed(changes) if changes else self
        try:
            return schema.StudyTable.model_validate(text.tables)
        except ValidationError as error:
            raise StudyError("\n".join(_messages(self.file, error, _line_numbers(self.source)))) from None

    def study(self, changes: Mapping[str, Any] | None = None, halvings: int = 0) -> Study:
        """Return the study, checked as far as can be without solving; raise StudyError."""
        text = self.changed(changes) if changes else self
        return _Builder(text, _finer(text.table(), halvings), halvings).study()


def _finer(table: schema.StudyTable, halvings: int) -> schema.StudyTable:
    """Return the tables of a study with elements of half the size, so many times, where it counts them."""
    mesh = table.mesh
    if not halvings or not isinstance(mesh, schema.RectangleTable | schema.BoxTable):
        return table
    elements = [count * 2**halvings for count in mesh.elements]
    return table.model_copy(update={"mesh": mesh.model_copy(update={"elements": elements})})


def read_text(file: str | Path) -> StudyText:
    """Read a study file; raise StudyError where it cannot be read or is no TOML."""
    place = Path(file)
    try:
        source = io.StringIO(read_file(place, StudyError).decode("utf-8-sig"), newline=None).read()
    except UnicodeDecodeError:
        raise StudyError(f"{place}: is not a text file in UTF-8; a study is TOML") from None
    _refuse_long_keys(place, source)
    try:
        tables = tomllib.loads(source)
    except RecursionError:
        raise StudyError(f"{place}: {_TOO_DEEP}") from None
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{place}: is not valid TOML: {one_line(str(error))}") from None
    except ValueError as error:
        raise StudyError(_value_error(place, source, error)) from None
    _refuse_deep(place, tables)
    return StudyText(place, source, tables)


def _value_error(file: Path, source: str, error: ValueError) -> str:
    """Say of an integer that Python refuses to read, of thousands of digits, where it stands."""
    for number, line in enumerate(source.splitlines(), 1):
        if re.search(r"\d[\d_]{999}", line):
            keys = [key for key, at in _line_numbers(source).items() if at == number]
            place = _place(file, keys[0], {keys[0]: number}) if keys else f"{file}:{number}"
            return f"{place}: an integer of thousands of digits is no value of any key"
    return f"{file}: is not valid TOML: {one_line(str(error))}"


# Tables in tables and lists in lists; no study has more than four.
_DEEPEST = 20
_TOO_DEEP = f"lists and tables are nested more than {_DEEPEST} deep: no key of a study takes that"


# Dotted keys, and lists of decimal numbers, have far fewer; tomllib's time grows with the square of a key's.
_MOST_DOTS = 100


def _refuse_long_keys(file: Path, source: str) -> None:
    for number, line in enumerate(source.splitlines(), 1):
        if any(part.count(".") > _MOST_DOTS for part in line.split("=")):
            raise StudyError(f"{file}:{number}: more than {_MOST_DOTS} dots: no key and no list of a study is so long")


def _refuse_deep(file: Path, tables: Mapping[str, Any]) -> None:
    """Raise StudyError where lists and tables are nested deeper than any key takes; what follows may then recurse."""
    held: list[Any] = [tables]
    for _ in range(_DEEPEST):
        held = [
            inner
            for one in held
            for inner in (one.values() if isinstance(one, Mapping) else one)
            if isinstance(inner, Mapping | list)
        ]
    if held:
        raise StudyError(f"{file}: {_TOO_DEEP}")


def read_study(file: str | Path, halvings: int = 0, changes: Mapping[str, Any] | None = None) -> Study:
    """Read and check a study file; raise StudyError with file, key, value and what is allowed.

    With `halvings` its mesh is that many times finer: elements of half the size, each time. With `changes` some keys
    have other values: {"material.young": "8 kPa", "load.1.force.2": -0.01}; lists count from 1.
    """
    return read_text(file).study(changes, halvings)


class _Builder:
    """Makes the objects table by table, so that every error names its table."""

    def __init__(self, text: StudyText, table: schema.StudyTable, halvings: int) -> None:
        self.text, self.table, self.halvings, self.file = text, table, halvings, text.file
        self.lines = _line_numbers(text.source)
        self.network: SpringNetwork | None = None

    @contextmanager
    def at(self, *key: str | int) -> Iterator[None]:
        """Name file, line and key in front of any error."""
        try:
            yield
        except TruespringError as error:
            if isinstance(error, StudyError) and str(error).startswith(f"{self.file}:"):  # named already, more closely
                raise
            raise StudyError(f"{_place(self.file, key, self.lines)}: {one_line(str(error))}") from None
        except OSError as error:
            told = f"{shown(str(error.filename))}: {error.strerror}" if error.filename else str(error)
            raise StudyError(f"{_place(self.file, key, self.lines)}: {told}") from None

    def study(self) -> Study:
        table = self.table
        problem = self.problem()
        solver = self.solver(problem)
        entries = {name: self.entry(problem, solver, name, entry) for name, entry in table.models.items()}
        model, references = self.compared(entries)
        with self.at("compare", "probe"):
            probe = _probe_node(problem.mesh, table.compare.probe)
        return Study(
            title=table.title or self.file.stem,
            text=self.text,
            table=table,
            halvings=self.halvings,
            problem=problem,
            solver=solver,
            entries=entries,
            model=model,
            references=references,
            probe=probe,
            tolerance=table.compare.tolerance,
            refine=table.compare.refine,
        )

    def solver(self, problem: Problem) -> Solver:
        table = self.table.solver
        past: dict[str, Any] = {"tolerance": table.tolerance, "max_iterations": table.max_iterations}
        past["linear"] = "direct" if table.linear == "auto" else table.linear
        for key in ("on", "direction", "to"):
            given = getattr(table, key) is not None
            if given != (table.control == "displacement"):
                with self.at("solver", key):
                    wanted = "is required and missing" if not given else "is"
                    raise StudyError(f'{wanted} for control = "displacement"')
        if table.direction is not None and table.to is not None:
            with self.at("solver", "on"):
                select(problem.mesh, table.on)
            with self.at("solver"):
                control = DisplacementControl(table.on, table.direction, table.to, table.load_steps, **past)
                check_solver(problem, control)
                return control
        if table.control == "arc-length":
            with self.at("solver", "linear"):
                return ArcLength(table.load_steps, table.max_steps, **past)
        with self.at("solver", "linear"):
            return Newton(
                load_steps=table.load_steps,
                tolerance=table.tolerance,
                max_iterations=table.max_iterations,
                method=table.method,
                linear=table.linear,
            )

    def problem(self) -> Problem:
        table = self.table
        with self.at("mesh"):
            mesh = self.mesh()
        material = None
        with self.at("material"):
            if table.material is not None:
                material = _material(table.material)
            elif self.network is None:
                raise StudyError("is required and missing")
        section = None if self.network else self.section(mesh)
        regions = []
        for number, region in enumerate(table.region):
            with self.at("region", number):
                select_elements(mesh, region.on)
                regions.append(Region(region.on, _material(region)))
        supports, loads = [], []
        for number, support in enumerate(table.support):
            with self.at("support", number, "on"):
                select(mesh, support.on)
            with self.at("support", number, "displacement"):
                _one_a_direction(support.displacement, mesh)
            with self.at("support", number, "about"):
                _one_a_direction(support.about, mesh)
            supports.append(
                Fixed(support.on, support.fix, support.displacement, support.rotation, support.about, support.axis)
            )
        for number, load in enumerate(table.load):
            if load.on is not None:
                with self.at("load", number, "on"):
                    select(mesh, load.on)
            for key, value in load.values.items():
                with self.at("load", number, key):
                    _one_a_direction(value if isinstance(value, list) else None, mesh)
            loads.append(load.load())
        try:
            return Problem(mesh, material, section, supports, loads, regions)
        except LoadError as error:
            with self.at("load", error.number):
                raise StudyError(error.text) from None
        except TruespringError as error:
            with self.at("load" if isinstance(error, NoLoadError) else "support"):
                raise

    def mesh(self) -> Mesh:
        match self.table.mesh:
            case schema.RectangleTable() as table:
                return rectangle(table.size, table.elements, table.element, table.diagonal)
            case schema.BoxTable() as table:
                return box(table.size, table.elements, table.element)
            case schema.VoxelsTable() as table:
                with self.at("mesh", "unit"):
                    unit_size(table.unit, "length")
                with self.at("mesh", "voxels"):
                    ready = table.voxels if table.voxels.startswith("pyvista:") else self.file.parent / table.voxels
                    mesh = read_voxels(ready, table.label, table.edge, table.unit)
                    return self.halved(mesh)
            case schema.NetworkMeshTable() as table:
                if self.halvings:
                    raise StudyError("a network cannot be refined: it is as fine as its springs are")
                self.network = read_network(*(self.file.parent / one for one in (table.nodes, table.springs)))
                return self.network.mesh
            case table:
                with self.at("mesh", "unit"):
                    unit_size(table.unit, "length")
                with self.at("mesh", "file"):
                    mesh = read_mesh(self.file.parent / table.file, table.unit, table.join)
                    refuse_too_large(mesh.n_nodes, mesh.dim)
                    return self.halved(mesh)

    def halved(self, mesh: Mesh) -> Mesh:
        for _ in range(self.halvings):
            refuse_too_large(2**mesh.dim * mesh.n_nodes, mesh.dim)
            mesh = refined(mesh)
        return mesh

    def section(self, mesh: Mesh) -> Section | None:
        table = self.table.section
        with self.at("section"):
            if mesh.dim == 3 and table is not None:
                raise StudyError("is for plane bodies: a body in 3D has none")
            if mesh.dim == 3:
                return None
            if table is None:
                raise StudyError(f"is required and missing; kind: {', '.join(SECTIONS)}, and a thickness")
            return SECTIONS[table.kind](table.thickness)

    def entry(self, problem: Problem, solver: Solver, name: str, table: Any) -> Model:
        with self.at("models", name):
            match table:
                case schema.StlTable():
                    beside = self.file.parent
                    undeformed = None if table.undeformed is None else beside / table.undeformed
                    read = read_stl(problem, beside / table.file, table.load_factor, undeformed, table.unit)
                    return ReadSolution(read)
                case schema.NetworkTable():
                    if self.network is None:
                        raise StudyError('kind = "network" is for a mesh of nodes and springs')
                    model: Model = self.network
                case schema.CalculixTable():
                    springs = None if table.springs is None else self.springs_of(problem, name, table.springs)
                    law = {} if table.law is None else {"law": table.law}
                    program = CalculiX(springs=springs, element=table.element, **law)
                    program.check_run(problem, solver)
                    return program
                case schema.FemTable():
                    model = Fem(table.law, table.element)
                case schema.HemlTable():
                    model = Heml(table.law)
                case schema.MassTensorTable():
                    model = MassTensor(table.law)
                case schema.TerzopoulosTable():
                    model = Terzopoulos(table.boundary)
                case schema.BemSpringsTable():
                    model = BemSprings(table.block, table.rule, table.corotated)
                case _:
                    model = self.springs(problem, table)
            model.check(problem)  # before anything is solved
            return model

    def springs(self, problem: Problem, table: schema.SpringsTable) -> Springs | GivenSprings:
        """Return springs by rule, by numbers, or as they are read spring by spring."""
        own = table.stiffness
        if own is None or own.file is None:
            return _springs(table)
        volume = None if own.volume is None else self.file.parent / own.volume
        return read_given(problem, self.file.parent / own.file, volume, table.allow_negative)

    def springs_of(self, problem: Problem, name: str, other: str) -> Model:
        """Return the springs of another model of the study, which `name` is to be a twin of."""
        tables = self.table.models
        kinds = (schema.SpringsTable, schema.NetworkTable)
        known = [one for one, table in tables.items() if isinstance(table, kinds)]
        with self.at("models", name, "springs"):
            match tables.get(other):
                case schema.SpringsTable() as table:
                    return self.springs(problem, table)
                case schema.NetworkTable() if self.network is not None:
                    return self.network
            told = f"there are {', '.join(known)}" if known else "there are none"
            raise StudyError(f"'{other}' is no model of springs of this study{nearest(other, known)}: {told}")

    def compared(self, entries: Mapping[str, Model]) -> tuple[str, tuple[str, ...]]:
        """Return the model that is compared, by default the first springs, and its references, by default the rest."""
        compare = self.table.compare
        springs = [name for name, entry in entries.items() if entry.has_springs]
        model = compare.model or (springs or list(entries))[0]
        self._known("model", model, entries)
        if compare.references is None:
            return model, tuple(name for name in entries if name != model)
        for reference in compare.references:
            self._known("references", reference, entries)
            if reference == model:
                with self.at("compare", "references"):
                    raise StudyError(f"'{reference}' is the model itself: name others, or leave the list empty")
        return model, tuple(dict.fromkeys(compare.references))

    def _known(self, key: str, name: str, entries: Mapping[str, Any]) -> None:
        if name not in entries:
            with self.at("compare", key):
                raise StudyError(f"'{name}' is not among the models{nearest(name, entries)}: {', '.join(entries)}")


def _one_a_direction(values: list[float] | None, mesh: Mesh) -> None:
    if values is not None and len(values) != mesh.dim:
        raise StudyError(f"{values} has {len(values)} values, the body has {mesh.dim} directions")


def _springs(table: schema.SpringsTable) -> Springs:
    own = None
    if table.stiffness is not None and table.stiffness.edge is not None:
        own = UserStiffness(table.stiffness.edge, table.stiffness.diagonal, table.stiffness.body)
    return Springs(table.rule, own, table.sharing, table.allow_negative, table.volume, table.k_body)


def _material(table: schema.MaterialTable) -> Material:
    constants = {name: getattr(table, name, None) for name in material_constants()}
    known = {name: value for name, value in constants.items() if value is not None}
    return Material(table.young, table.poisson, table.density, known)


_OTHER_MESHES = "file = a mesh file, voxels = a label image, nodes and springs = CSV files"


def _probe_node(mesh: Mesh, probe: str | tuple[float, ...] | None) -> int | None:
    if probe is None:
        return None
    return named_point(mesh, probe) if isinstance(probe, str) else nearest_node(mesh, probe)


def _messages(file: Path, error: ValidationError, lines: Mapping[tuple[str | int, ...], int]) -> list[str]:
    """One line a fault; a missing key is not told where an unknown one beside it is its misspelling."""
    faults = error.errors()
    meant: set[tuple[str | int, ...]] = set()
    for fault in faults:
        if fault["type"] == "extra_forbidden":
            *table, word = fault["loc"]
            meant.update((*table, guess) for guess in close_words(str(word), _allowed_keys(tuple(table))))
    told = [fault for fault in faults if fault["type"] != "missing" or fault["loc"] not in meant]
    return [_message(file, fault, lines) for fault in told]


def _message(file: Path, error: Any, lines: Mapping[tuple[str | int, ...], int]) -> str:
    """One line for one fault that pydantic found."""
    key = _without_tag(error["loc"])
    place = _place(file, key, lines)
    value, text = error["input"], str(error["msg"])
    match error["type"]:
        case "missing":
            return f"{place}: is required and missing"
        case "extra_forbidden":
            allowed = _allowed_keys(error["loc"][:-1])
            found = "" if isinstance(value, dict | list) else f" = {shown(value)}"
            return f"{place}{found}: unknown key{nearest(str(key[-1]), allowed)}; allowed: {', '.join(allowed)}"
        case "value_error":
            return f"{place}: {one_line(text.removeprefix('Value error, '))}"
        case "literal_error":
            expected = error["ctx"]["expected"]
            words = re.findall(r"'([^']*)'", expected)
            return f"{place} = {shown(value)}: allowed: {expected}{nearest(shown(value), words)}"
        case "union_tag_invalid" | "union_tag_not_found" if key == ("mesh",):
            given = value.get("shape") if isinstance(value, dict) else value
            if given is None:
                return f"{place}: shape is required and missing; allowed: rectangle, box; or {_OTHER_MESHES}"
            close = nearest(shown(given), ("rectangle", "box"))
            return f"{place}.shape = {shown(given)}{close}; allowed: 'rectangle' or 'box'; or {_OTHER_MESHES}"
        case "union_tag_invalid" | "union_tag_not_found":
            given = value.get("kind") if isinstance(value, dict) else value
            kinds = schema.MODEL_KINDS
            return f"{place}: kind = {shown(given)}{nearest(shown(given), kinds)}; allowed: {', '.join(kinds)}"
        case "string_pattern_mismatch" if error["loc"][-1] == "[key]":
            return f"{place}: a model's name is made of letters, digits, '_' and '-', it names files"
        case _:
            found = "" if isinstance(value, dict | list) and len(str(value)) > 60 else f" = {shown(value)}"
            return f"{place}{found}: {text[0].lower()}{text[1:]}"


def _without_tag(loc: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """Drop the kind that pydantic puts behind a model's name, and its mark of a faulty key."""
    key = loc[:2] + loc[3:] if loc[0] == "models" and len(loc) > 2 else loc
    key = key[:1] + key[2:] if key[0] == "mesh" and len(key) > 2 else key
    return tuple(part for part in key if part != "[key]")


def _allowed_keys(loc: tuple[str | int, ...]) -> list[str]:
    """The keys of the table at `loc`."""
    tables: dict[str | int, type[schema.Table]] = {
        "region": schema.RegionTable,
        "material": schema.MaterialTable,
        "section": schema.SectionTable,
        "support": schema.SupportTable,
        "load": schema.load_form(LOADS),
        "solver": schema.SolverTable,
        "compare": schema.CompareTable,
    }
    if not loc:
        return list(schema.StudyTable.model_fields)
    if loc[0] == "mesh":
        meshes: dict[str, type[schema.Table]]
        meshes = {"rectangle": schema.RectangleTable, "box": schema.BoxTable, "file": schema.FileTable}
        meshes |= {"voxels": schema.VoxelsTable, "springs": schema.NetworkMeshTable}
        return list(meshes[str(loc[1])].model_fields)
    if loc[-1] == "stiffness":
        return list(schema.StiffnessTable.model_fields)
    return list((schema.MODEL_KINDS[str(loc[2])] if loc[0] == "models" else tables[loc[0]]).model_fields)


def _place(file: Path, key: tuple[str | int, ...], lines: Mapping[tuple[str | int, ...], int]) -> str:
    """File, line of the key or of the nearest table around it, and the key; lists count from 1."""
    known = next((lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in lines), None)
    dotted = one_line(".".join(str(part + 1) if isinstance(part, int) else part for part in key), 200)
    return f"{file}:{known}: {dotted}" if known else f"{file}: {dotted}"


def _line_numbers(source: str) -> dict[tuple[str | int, ...], int]:
    """The line of each table and key that is written in the plain way; others fall back to the table around."""
    lines: dict[tuple[str | int, ...], int] = {}
    count: dict[str, int] = {}
    table: tuple[str | int, ...] = ()
    for number, line in enumerate(source.splitlines(), 1):
        if found := re.match(r"\s*\[\[\s*([\w.\-]+)\s*\]\]", line):
            count[found[1]] = count.get(found[1], -1) + 1
            table = (*found[1].split("."), count[found[1]])
            lines[table] = number
            lines.setdefault(table[:-1], number)
        elif found := re.match(r"\s*\[\s*([\w.\-]+)\s*\]", line):
            table = tuple(found[1].split("."))
            lines[table] = number
        elif found := re.match(r"\s*([\w\-]+)\s*=", line):
            lines[(*table, found[1])] = number
    return lines
