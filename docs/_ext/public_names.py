"""The public names by topic."""

import inspect
from collections.abc import Mapping
from pathlib import Path

import truespring as ts

#: Topics and their names; each public name has one.
TOPICS: dict[str, tuple[str, ...]] = {
    "Problem": (
        *("Problem", "Material", "PlaneStress", "PlaneStrain", "Fibres", "Region"),
        *("Fixed", "Force", "Traction", "Pressure", "Moment", "Gravity", "ActiveTension"),
    ),
    "Mesh": (
        *(
            "Mesh",
            "rectangle",
            "box",
            "read_mesh",
            "read_voxels",
            "Box",
            "Near",
            "Plane",
            "mapped",
            "named_point",
            "nearest_node",
        ),
    ),
    "Models": (
        *("Springs", "Fem", "UserStiffness", "SpringNetwork", "PrescribedSprings", "BemSprings", "Heml", "MassTensor"),
        *("Terzopoulos", "CalculiX", "RULES", "LAWS"),
    ),
    "Moduli and fitness": ("moduli", "Moduli", "judge", "Fitness"),
    "Equilibrium": ("solve", "Newton", "DisplacementControl", "ArcLength", "Solution", "State", "Status"),
    "Motion and tools": (
        *("Dynamics", "Damping", "Sphere", "Capsule", "HalfSpace", "Block", "StlTool", "Grasp", "modes", "Modes"),
        *("Live",),
    ),
    "Comparison": ("compare", "Comparison", "reference_error", "OwnError", "read_result", "read_stl"),
    "Studies": ("new", "read_study", "Study", "verify", "Result", "read_network", "export", "ProgressBar"),
    "Accuracy over loads, meshes and parameters": (
        *(
            "converge",
            "map_validity",
            "Validity",
            "sweep",
            "Sweep",
            "calibrate",
            "Calibration",
            "LoadCase",
            "read_curve",
        ),
        *("draw_calibration",),
    ),
    "Errors and versions": ("TruespringError", "Report"),
}


def check() -> None:
    """Raise an error unless each public name has one topic, and each name of a topic is public."""
    grouped = [name for names in TOPICS.values() for name in names]
    wrong = set(ts.__all__) ^ set(grouped) | {name for name in grouped if grouped.count(name) > 1}
    if wrong := {name for name in wrong if not name.startswith("__")}:
        raise ValueError(
            f"public names with no topic or several, or topics of names that are not public: {sorted(wrong)}"
        )


def public_names() -> str:
    """Return the public names by topic as markdown, each with its first line and a link to its page."""
    check()
    lines: list[str] = []
    for topic, names in TOPICS.items():
        lines += [f"## {topic}", "", "| name | content |", "|---|---|"]
        lines += [f"| [`{name}`](api/{name}.rst) | {summary(name)} |" for name in names]
        lines += ["", "```{toctree}", ":hidden:", "", *(f"api/{name}" for name in names), "```", ""]
    return "\n".join(lines)


def summary(name: str) -> str:
    """Return the first line of the docstring of a public name, for a cell of a table."""
    thing = getattr(ts, name)
    if isinstance(thing, Mapping):
        return f"Table of {len(thing)} entries: {', '.join(f'`{key}`' for key in thing)}."
    line = (inspect.getdoc(thing) or "").partition("\n")[0]
    return line.replace("|", "\\|").replace("*", "\\*")


def write_pages(folder: Path) -> None:
    """Write a page for each public name, and remove those of names that are gone."""
    check()
    folder.mkdir(parents=True, exist_ok=True)
    for file in folder.glob("*.rst"):
        if file.stem not in ts.__all__:
            file.unlink()
    for name in (name for names in TOPICS.values() for name in names):
        thing = getattr(ts, name)
        kind = "data" if isinstance(thing, Mapping) else "class" if inspect.isclass(thing) else "function"
        text = f"{name}\n{'=' * len(name)}\n\n.. currentmodule:: truespring\n\n.. auto{kind}:: {name}\n"
        if kind == "data":
            text += "   :no-value:\n"
        file = folder / f"{name}.rst"
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")
