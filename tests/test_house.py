"""The picture of imports: problem x model x solver -> path -> comparison -> report, one way only."""

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

import truespring
from truespring.cli.parser import VERBS

SOURCE = Path(truespring.__file__).parent

# What each room may import of the others; arrays and errors are open to all.
ALLOWED = {
    "__main__": {"cli"},
    "accessor": {"material", "mesh", "models", "problem"},
    "cli": {
        "calibration",
        "comparing",
        "converging",
        "equilibrium",
        "exports",
        "fibres",
        "linear",
        "live",
        "models",
        "outputs",
        "reference",
        "report",
        "study",
        "sweeping",
        "table1",
        "templates",
        "validity",
        "verifying",
        "vibration",
    },
    "live": {
        "coarsening",
        "columns",
        "conditions",
        "dynamics",
        "equilibrium",
        "loading",
        "material",
        "mesh",
        "models",
        "motion",
        "potential",
        "problem",
        "richardson",
        "solvers",
        "study",
        "tools",
        "report",
        "vibration",
    },
    "table1": {
        "report",
        "outputs",
        "comparison",
        "equilibrium",
        "models",
        "solvers",
        "problem",
        "loading",
        "mesh",
        "material",
        "conditions",
    },
    "validity": {
        "showing",
        "sweeping",
        "outputs",
        "study",
        "report",
        "comparison",
        "support_errors",
        "equilibrium",
        "converging",
        "richardson",
        "models",
        "solvers",
        "potential",
        "problem",
        "loading",
        "mesh",
        "conditions",
    },
    "calibration": {
        "showing",
        "carrying",
        "comparison",
        "support_errors",
        "equilibrium",
        "linear",
        "material",
        "mesh",
        "models",
        "outputs",
        "potential",
        "problem",
        "reactions",
        "reference",
        "refining",
        "report",
        "solvers",
        "study",
        "columns",
        "units",
    },
    "comparing": {
        "comparison",
        "equilibrium",
        "mesh",
        "misfit",
        "outputs",
        "problem",
        "reactions",
        "reference",
        "report",
        "study",
        "units",
    },
    "converging": {
        "showing",
        "richardson",
        "comparison",
        "equilibrium",
        "mesh",
        "outputs",
        "report",
        "study",
    },
    "sweeping": {"study", "report", "outputs", "showing"},
    "verifying": {"models", "outputs", "potential", "problem", "report", "showing", "solution", "solvers", "study"},
    "templates": set(),
    "versions": set(),
    "showing": {"comparison", "mesh", "models", "outputs", "potential", "problem", "report", "solution", "units"},
    "study": {
        "outputs",
        "showing",
        "refining",
        "report",
        "comparison",
        "reference",
        "exports",
        "equilibrium",
        "reactions",
        "models",
        "solvers",
        "problem",
        "loading",
        "mesh",
        "material",
        "fibres",
        "columns",
        "units",
        "potential",
        "program",
        "tools",
        "dynamics",
    },
    "report": {
        "dynamics",
        "tools",
        "comparison",
        "support_errors",
        "refining",
        "equilibrium",
        "reactions",
        "models",
        "potential",
        "conditions",
        "problem",
        "loading",
        "mesh",
        "material",
    },
    "vibration": {
        "equilibrium",
        "linear",
        "models",
        "outputs",
        "potential",
        "problem",
        "program",
        "conditions",
        "report",
        "rigid_modes",
        "study",
        "mesh",
    },
    "coarsening": {"models", "problem", "material", "mesh", "conditions", "potential"},
    "comparison": {"carrying", "support_errors", "solution", "problem", "mesh"},
    "support_errors": {"reactions", "solution"},
    "refining": {"comparison", "equilibrium", "models", "solvers", "potential", "problem", "mesh", "richardson"},
    "carrying": {"solution", "problem", "mesh"},
    "misfit": {"comparison", "solution"},
    "reference": {
        "exports",
        "equilibrium",
        "models",
        "solvers",
        "problem",
        "loading",
        "mesh",
        "columns",
        "units",
        "program",
        "conditions",
    },
    "exports": {
        "outputs",
        "equilibrium",
        "linear",
        "models",
        "solvers",
        "potential",
        "problem",
        "loading",
        "mesh",
        "material",
        "conditions",
        "dynamics",
        "motion",
        "tools",
    },
    "equilibrium": {
        "coarsening",
        "dynamics",
        "motion",
        "linear",
        "piecewise",
        "program",
        "ranks",
        "soundness",
        "solution",
        "models",
        "solvers",
        "potential",
        "problem",
        "mesh",
        "conditions",
    },
    "program": {"solution", "models", "solvers", "problem"},
    "motion": {"conditions", "dynamics", "linear", "potential", "solvers"},
    "soundness": {"solution", "dynamics", "problem", "mesh"},
    "solution": {"reactions", "dynamics", "models", "solvers", "potential", "problem", "mesh", "conditions"},
    "reactions": {"problem", "loading"},
    "models": {
        "linear",
        "potential",
        "problem",
        "loading",
        "mesh",
        "material",
        "fibres",
        "units",
        "assembly",
        "conditions",
        "rigid_modes",
    },
    "piecewise": {"models", "problem", "conditions", "potential", "ranks"},
    "solvers": {"linear", "potential", "conditions", "dynamics", "ranks"},
    "linear": {"potential", "rigid_modes", "ranks"},
    "problem": {"loading", "tools", "dynamics", "mesh", "material", "fibres", "conditions", "rigid_modes"},
    "tools": {"loading", "mesh", "conditions", "units"},
    "dynamics": set(),
    "loading": {"potential", "mesh", "units", "assembly", "conditions"},
    "conditions": {"potential"},
    "assembly": {"potential"},
    "potential": set(),
    "rigid_modes": set(),
    "mesh": {"units"},
    "material": {"fibres"},
    "fibres": {"mesh"},
    "columns": {"units"},
    "richardson": set(),
    "units": set(),
    "outputs": set(),
    "kernels": set(),
    "errors": set(),
    "arrays": set(),
    "completing": set(),
    "plugins": set(),
    "memory": set(),
    "ranks": set(),
    "remembering": set(),
    "deprecation": set(),
    "opening": set(),
}
OPEN_TO_ALL = {
    *("arrays", "completing", "deprecation", "errors", "memory", "opening", "kernels", "remembering", "plugins"),
}
# The room that methods import when they are called, to show or write a value: it is above their own.
SHOWING = "truespring.showing."
HEAVY = {
    "matplotlib",
    "pyvista",
    "vtk",
    "numba",
    "pyamg",
    "pint",
    "rich",
    "jinja2",
    "mujoco",
    "mpi4py",
    "petsc4py",
    "ansys",
    "dask",
    "distributed",
    "polars",
    "pandas",
    "xarray",
    "h5py",
    "meshio",
    "IPython",
    "starlette",
    "uvicorn",
    "websockets",
}


def rooms() -> dict[str, list[Path]]:
    found: dict[str, list[Path]] = {}
    for file in SOURCE.rglob("*.py"):
        room = file.relative_to(SOURCE).parts[0].removesuffix(".py")
        found.setdefault(room, []).append(file)
    del found["__init__"]  # the public names, each once
    return found


@cache
def tree_of(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def nodes_of(file: Path) -> list[ast.AST]:
    """Imports and calls of a file, found in one walk."""
    return [node for node in ast.walk(tree_of(file)) if isinstance(node, ast.Import | ast.ImportFrom | ast.Call)]


@cache
def imported(file: Path, everywhere: bool = True, modules: frozenset[str] = frozenset()) -> set[str]:
    """Dotted names that a file imports, at its top only or everywhere; of a package those `modules` that it names."""
    tree = tree_of(file)
    names: set[str] = set()
    thin = {id(method.body[-2]) for method in thin_methods(tree)}
    for node in nodes_of(file) if everywhere else tree.body:
        if id(node) in thin:
            continue
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, f"{file}: relative import"
            parts = {f"{node.module}.{alias.name}" for alias in node.names} & modules
            names |= parts or {node.module}
    return names


def thin_methods(tree: ast.Module) -> list[ast.FunctionDef]:
    """Methods that only show a value: a docstring, an import of a function of SHOWING, and its call."""
    return [
        method
        for value in tree.body
        if isinstance(value, ast.ClassDef)
        for method in value.body
        if isinstance(method, ast.FunctionDef) and is_thin(method)
    ]


def is_thin(method: ast.FunctionDef) -> bool:
    if len(method.body) != 3 or ast.get_docstring(method) is None:
        return False
    _, imports, call = method.body
    if not (isinstance(imports, ast.ImportFrom) and (imports.module or "").startswith(SHOWING)):
        return False
    return (
        len(imports.names) == 1
        and isinstance(call, ast.Return)
        and isinstance(call.value, ast.Call)
        and isinstance(call.value.func, ast.Name)
        and call.value.func.id == imports.names[0].name
    )


def test_methods_that_show_a_value_only_call_the_room_on_top() -> None:
    """What `imported` leaves out: the import of a thin method, no other import of this room."""
    found = {
        (file.stem, method.name)
        for files in rooms().values()
        for file in files
        for method in thin_methods(tree_of(file))
    }
    assert found >= {("solution", "plot"), ("solution", "write"), ("mesh", "to_pyvista"), ("mesh", "from_pyvista")}
    more = "class A:\n def plot(self):\n  'Plot.'\n  from truespring.showing.plotting import plot\n"
    for end, thin in (("return plot(self)", True), ("return plot(self) + 1", False), ("return draw(self)", False)):
        assert bool(thin_methods(ast.parse(f"{more}  {end}"))) == thin


def test_imports_run_one_way() -> None:
    assert set(rooms()) == set(ALLOWED)
    for room, files in rooms().items():
        for file in files:
            ours = {name.split(".")[1] for name in imported(file) if name.startswith("truespring.")}
            assert ours - {room} - OPEN_TO_ALL <= ALLOWED[room], f"{file} imports {ours}"
            assert "truespring" not in imported(file), f"{file} imports the public names"


def test_the_picture_has_no_cycle() -> None:
    left = {room: set(others) for room, others in ALLOWED.items()}
    while left:
        lowest = [room for room, others in left.items() if not others & left.keys()]
        assert lowest, f"a cycle among {sorted(left)}"
        for room in lowest:
            del left[room]


def test_no_files_import_each_other() -> None:
    """Also where they import inside functions; what a package only gathers in its __init__ is no file of its own."""
    files = {
        "truespring." + ".".join(file.relative_to(SOURCE).with_suffix("").parts): file
        for several in rooms().values()
        for file in several
    }
    left = {
        name: (imported(file) & files.keys()) - {name}
        for name, file in files.items()
        if not name.startswith("truespring.models.")
    }
    assert len(left) > 200
    while True:
        others = {name for several in left.values() for name in several}
        ends = [name for name, several in left.items() if not several & left.keys() or name not in others]
        if not ends:
            break
        for name in ends:
            del left[name]
        left = {name: several & left.keys() for name, several in left.items()}
    assert not left, f"a circle among {sorted(left)}"


def files_in_a_circle(files: dict[str, Path]) -> set[str]:
    """Names of the files, by their dotted names, that import each other in a circle or import one that does."""
    left = {name: (imported(file, modules=frozenset(files)) & files.keys()) - {name} for name, file in files.items()}
    while lowest := [name for name, others in left.items() if not others & left.keys()]:
        for name in lowest:
            del left[name]
    return set(left)


def test_no_room_has_a_circle() -> None:
    """Imports inside functions count too: they hide a circle, and do not break it."""
    for files in rooms().values():
        names = {
            ".".join(file.relative_to(SOURCE.parent).with_suffix("").parts).removesuffix(".__init__"): file
            for file in files
        }
        assert not files_in_a_circle(names)


def test_a_circle_is_found(tmp_path: Path) -> None:
    texts = {
        "truespring.room": "from truespring.room.first import a",
        "truespring.room.first": "def a():\n    from truespring.room.second import b",
        "truespring.room.second": "from truespring.room.first import a",
        "truespring.room.third": "import truespring.mesh",
    }
    files = {name: tmp_path / name for name in texts}
    for name, text in texts.items():
        files[name].write_text(text, encoding="utf-8")
    assert files_in_a_circle(files) == set(texts) - {"truespring.room.third"}


def test_heavy_libraries_are_imported_where_they_are_used() -> None:
    for room, files in rooms().items():
        for file in files:
            at_top = imported(file, everywhere=False)
            heavy = {name.split(".")[0] for name in at_top} & HEAVY
            if room == "kernels":
                assert heavy <= {"numba"}, f"{file} imports {heavy} at its top"
                continue
            # Of scipy only its sparse matrices are needed by every command.
            heavy |= {name for name in at_top if re.match(r"skfem|scipy\.(?!sparse$|sparse\.cs._array)", name)}
            assert not heavy, f"{file} imports {heavy} at its top"
            assert not any(name.startswith("truespring.kernels") for name in at_top), f"{file} imports numba at its top"


def test_what_is_imported_is_a_declared_dependency() -> None:
    project = tomllib.loads((SOURCE.parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    declared = [*project["dependencies"], *(one for name in extras.keys() - {"test"} for one in extras[name])]
    modules = {"scikit-fem": "skfem", "lazy-loader": "lazy_loader", "ansys-mapdl-reader": "ansys", "pillow": "PIL"}
    modules |= {"imageio-ffmpeg": "imageio_ffmpeg", "ipython": "IPython"}
    names = [re.split("[<>=]", one)[0] for one in declared]
    allowed = {modules.get(name, name) for name in names} | {"truespring", *sys.stdlib_module_names}
    for files in rooms().values():
        for file in files:
            assert {name.split(".")[0] for name in imported(file)} <= allowed, file


def test_the_library_neither_prints_nor_exits() -> None:
    for room, files in rooms().items():
        for file in files:
            calls = [node.func for node in nodes_of(file) if isinstance(node, ast.Call)]
            named = {call.id for call in calls if isinstance(call, ast.Name)}
            assert room == "cli" or not named & {"print", "exit", "input"}, file
            assert room == "__main__" or "sys.exit" not in file.read_text(encoding="utf-8"), file


def test_a_public_name_is_no_module() -> None:
    """A function named like a module would be hidden by it as soon as that is imported."""
    modules = {path.stem for path in SOURCE.iterdir()}
    assert len(truespring.__all__) > 25
    assert not set(truespring.__all__) & modules
    for name in truespring.__all__:
        assert name in ("LAWS", "RULES") or getattr(truespring, name).__name__ == name


def test_the_help_of_a_verb_loads_nothing_heavy() -> None:
    asked = """
import sys
from truespring.cli import main
from truespring.cli.parser import VERBS
heavy = set(sys.argv[1:])
for name in VERBS:
    assert main([name, "--help"]) == 0
    print("loaded:", name, *heavy & {module.split(".")[0] for module in sys.modules})
"""
    heavy = [*HEAVY, "numpy", "scipy", "skfem", "pydantic"]
    command = [sys.executable, "-c", asked, *heavy]
    shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    loaded = [line.split()[1:] for line in shown if line.startswith("loaded:")]
    assert [name for name, *_ in loaded] == list(VERBS)
    assert not [line for line in loaded if len(line) > 1]


@pytest.mark.parametrize(("former", "name"), truespring._RENAMED.items())
def test_a_former_name_warns_and_works(former: str, name: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"use truespring.{name}"):
        assert getattr(truespring, former) is getattr(truespring, name)
