"""Studies by number: valid ones, made of the tables of names, and spoilt ones; the same number gives the same text.

What they may ask comes from the schema and the tables (RULES, LAWS, ELEMENTS, ...), so that a new entry is generated
as soon as it is there.
"""

import copy
import json
import random
import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, get_args

from tests.closed_forms import material_of
from truespring.cli import main
from truespring.loading import LOADS
from truespring.material import SECTIONS
from truespring.mesh import DIAGONALS, PLANE_ELEMENTS, SOLID_ELEMENTS
from truespring.models import ELEMENTS, LAWS, RULES
from truespring.models.gaussian_rule import GAUSSIAN_LAWS
from truespring.models.gaussian_weights import HOURGLASS_LIMITS
from truespring.models.heml import HEML_LAWS
from truespring.models.mass_tensor import TENSOR_LAWS
from truespring.study import schema
from truespring.study.toml import toml_text

# No study of a handful of elements takes longer [s]: three models that all fail after 2,200 factorisations took 29 s of
# a slow processor.
PATIENCE = 60
# Of an exception that ends a model these kinds tell of a fault in the program, not of numbers that ran away.
OWN_FAULTS = (
    "TypeError",
    "IndexError",
    "KeyError",
    "AttributeError",
    "AssertionError",
    "NameError",
    "Unbound",
    "ZeroD",
)

Tables = dict[str, Any]


def words(table: type[schema.Keys], key: str) -> tuple[str, ...]:
    """What a key takes that is one of several words."""
    return tuple(get_args(table.model_fields[key].annotation))


def study(number: int) -> str:
    """Return the text of a study: valid as a rule where the number is even, spoilt where it is odd."""
    rng = random.Random(number)
    tables = valid(rng)
    if number % 2 == 0:
        return toml_text(tables)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        spoil(rng, tables)
    text = toml_text(tables)
    return garbled(rng, text) if rng.random() < 0.15 else text


# --- valid studies --------------------------------------------------------------------------------


def valid(rng: random.Random) -> Tables:
    """Return the tables of a study of a few elements."""
    dim = rng.choice((2, 2, 3))
    scale = 1.0 if rng.random() < 0.85 else 10 ** rng.uniform(-9, 9)
    size = [scale * rng.uniform(0.05, 0.2) * (4 if axis == 0 and rng.random() < 0.5 else 1) for axis in range(dim)]
    tables: Tables = {"title": rng.choice(("a beam", "Körper № 7", "日本語", "")), "mesh": _mesh(rng, dim, size)}
    tables["material"] = _material(rng)
    if rng.random() < 0.15:
        corner = [side / 2 for side in size]
        tables["region"] = [{"on": {"box": [[0.0] * dim, corner]}, **_material(rng)}]
        if rng.random() < 0.5:
            tables["region"][0]["on"] = {"box": [*[0.0] * dim, *size]}
    if dim == 2:
        tables["section"] = {"kind": rng.choice(list(SECTIONS)), "thickness": _length(rng, 0.01)}
    tables["support"] = [{"on": "left"}]
    driven = rng.random() < 0.25
    if driven:
        tables["support"].append(_moved(rng, dim, size))
    if not driven or rng.random() < 0.2:
        young = _si(tables["material"]["young"])
        tables["load"] = [_load(rng, dim, size, young) for _ in range(rng.choice((1, 1, 1, 2)))]
        if any("gravity" in one for one in tables["load"]):
            tables["material"].setdefault("density", 1000.0)
            for region in tables.get("region", []):
                region.setdefault("density", 1000.0)
        if any("tension" in one for one in tables["load"]):
            for one in (tables["material"], *tables.get("region", [])):
                one["fibres"] = {"along": [1.0, *[0.0] * (dim - 1)]}
    tables["solver"] = _solver(rng, dim, size, driven)
    element = tables["mesh"].get("element", "quadrilateral" if dim == 2 else "hexahedron").removeprefix("bcc-")
    tables["models"] = {f"{rng.choice('abcxyz')}{n}": _model(rng, element) for n in range(rng.choice((1, 2, 2, 3)))}
    for one in (tables["material"], *tables.get("region", [])):
        _add_constants(one, [model["law"] for model in tables["models"].values() if "law" in model])
    if rng.random() < 0.4:
        tables["compare"] = _compare(rng, dim, size, list(tables["models"]))
    return tables


def _mesh(rng: random.Random, dim: int, size: list[float]) -> Tables:
    depth = rng.choice((1, 1, 2))
    square = size[1] / depth
    if rng.random() < 0.6:  # squares and cubes, which most rules are for
        size[0] = square * rng.choice((1, 2, 3, 4))
        size[2:] = [square * rng.choice((1, 2)) for _ in size[2:]]
        elements = [max(1, round(side / square)) for side in size]
    else:
        elements = [rng.choice((1, 2, 3)), depth, *[1 for _ in size[2:]]]
    mesh: Tables = {"shape": "rectangle" if dim == 2 else "box", "elements": elements}
    mesh["size"] = [_length(rng, side) for side in size]
    if rng.random() < 0.7:
        mesh["element"] = rng.choice(sorted(PLANE_ELEMENTS if dim == 2 else SOLID_ELEMENTS))
    if mesh.get("element") == "triangle" and rng.random() < 0.5:
        mesh["diagonal"] = rng.choice(sorted(DIAGONALS))
    return mesh


def _length(rng: random.Random, value: float) -> Any:
    return rng.choice((value, f"{1000 * value!r} mm", f"{value!r} m", f"{100 * value!r} cm"))


def _material(rng: random.Random) -> Tables:
    young = 10 ** (rng.uniform(2, 11) if rng.random() < 0.9 else rng.uniform(-20, 25))
    poisson = rng.choice((0, 0.25, 0.3, 1 / 3, 0.45, 0.499, 0.49999999, -0.3, rng.uniform(-0.9, 0.49)))
    material: Tables = {"young": rng.choice((young, f"{young / 1000!r} kPa", f"{young / 1e6!r} MPa"))}
    material["poisson"] = poisson
    if rng.random() < 0.3:
        material["density"] = rng.choice((1000.0, "1000 kg/m^3", "1 g/cm^3"))
    return material


def _add_constants(material: Tables, laws: list[str]) -> None:
    """Add the constants of laws to a material, those that are stresses by its modulus; and the moduli they give."""
    for law in laws:
        young = _si(material["young"])
        whole = material_of(law, young, material["poisson"])
        material |= dict(whole.constants)
        if LAWS[law].lame is not None:
            material["poisson"] = whole.poisson


def _si(value: Any) -> float:
    if isinstance(value, str):
        number, unit = value.split()
        return float(number) * {"kPa": 1e3, "MPa": 1e6}[unit]
    return float(value)


def _moved(rng: random.Random, dim: int, size: list[float]) -> Tables:
    support: Tables = {"on": rng.choice(("right", "right-middle", "right"))}
    if rng.random() < 0.3 and support["on"] == "right":
        support["rotation"] = rng.choice(("20 deg", 0.3, -0.05, 7.0))
        if dim == 3:
            support["axis"] = rng.choice(([1.0, 0.0, 0.0], [0.0, 1.0, 1.0]))
        if rng.random() < 0.5:
            support["about"] = [side / 2 for side in size]
        return support
    support["displacement"] = [rng.uniform(-0.2, 0.2) * size[0] * rng.choice((0, 1, 1)) for _ in range(dim)]
    if rng.random() < 0.4:
        axis = rng.randrange(dim)
        support["fix"] = ["xyz"[axis]]
        support["displacement"] = [0.1 * size[0] if one == axis else 0.0 for one in range(dim)]
    return support


def _load(rng: random.Random, dim: int, size: list[float], young: float) -> Tables:
    key = rng.choice([*LOADS, "force", "traction"])
    key = key if dim in LOADS[key].dims else "force"
    strain = rng.uniform(-5, -1) if rng.random() < 0.85 else rng.uniform(-14, 2)
    stress = young * 10**strain * rng.choice((1, -1))
    section = size[1] * (size[2] if dim == 3 else 0.01)
    place = rng.choice(("right", "right", "top", "right-middle", {"x": size[0]}, {"near": list(size)}))
    match key:
        case "force":
            return {"on": place, "force": _vector(rng, dim, stress * section)}
        case "traction":
            return {"on": rng.choice(("right", "top")), "traction": _vector(rng, dim, stress)}
        case "pressure":
            return {"on": rng.choice(("right", "top", "bottom")), "pressure": stress}
        case "moment":
            return {"on": "right", "moment": stress * section * size[1]}
        case "gravity":
            return {"gravity": _vector(rng, dim, 9.81)}
    sizes = {"stress": stress, "force": stress * section, "moment": stress * section * size[1], "length": size[0]}
    several = {name: (one, sizes.get(one.dimension, 1.0)) for name, one in LOADS[key].quantities(key).items()}
    load = {name: _vector(rng, dim, value) if one.vector else value for name, (one, value) in several.items()}
    return {**({"on": rng.choice(("right", "top"))} if LOADS[key].needs_selection else {}), **load}


def _vector(rng: random.Random, dim: int, size: float) -> list[float]:
    vector = [0.0] * dim
    for axis in rng.sample(range(dim), rng.choice((1, 1, 2))):
        vector[axis] = size * rng.choice((1, 0.3, -1))
    return vector


def _solver(rng: random.Random, dim: int, size: list[float], driven: bool) -> Tables:
    solver: Tables = {"load_steps": rng.choice((1, 1, 2, 3)), "max_iterations": rng.choice((10, 15, 20))}
    solver["control"] = rng.choice(("load", *words(schema.SolverKeys, "control")))
    if driven and solver["control"] == "displacement":  # what moves is held
        solver["control"] = "load"
    if solver["control"] == "displacement":
        axis = rng.randrange(dim)
        to = size[0] * rng.choice((0.1, -0.1, 0.4))
        solver |= {"on": rng.choice(("right", "right-middle", "right-top")), "direction": "xyz"[axis], "to": to}
    if solver["control"] == "arc-length":
        solver["max_steps"] = rng.choice((1, 10, 20))
    if solver["control"] == "load":
        solver["method"] = rng.choice(words(schema.SolverKeys, "method"))
        if rng.random() < 0.3:
            solver["linear"] = rng.choice(
                [one for one in words(schema.SolverKeys, "linear") if one not in ("pardiso", "petsc")]
            )
    return solver


def _model(rng: random.Random, element: str) -> Tables:
    """A model that is for these elements, as far as tables tell."""
    simplices = element in ("triangle", "tetrahedron")
    kinds = [kind for kind in schema.MODEL_KINDS if kind not in ("stl", "network", "calculix", "bem-springs")]
    kinds = [kind for kind in kinds if not (simplices and kind == "terzopoulos")]
    kind = rng.choice([*kinds, *["springs"] * 3, *["fem"] * 3])
    model: Tables = {"kind": kind}
    match kind:
        case "springs":
            if rng.random() < 0.2:
                model["stiffness"] = {"edge": rng.uniform(0.05, 0.6)}
                model["stiffness"] |= {} if simplices else {"diagonal": rng.uniform(0.05, 0.6)}
            else:
                model["rule"] = rng.choice([name for name, rule in RULES.items() if element in rule.elements])
            if rng.random() < 0.2 and not ("rule" in model and RULES[model["rule"]].coupled):
                model["sharing"] = rng.choice(words(schema.SpringsKeys, "sharing"))
            model["allow_negative"] = rng.random() < 0.9
            model["volume"] = rng.random() < (0.4 if model.get("rule") == "isotropic" else 0.02)
        case "terzopoulos":
            model["boundary"] = rng.choice(words(schema.TerzopoulosKeys, "boundary"))
        case "mass-tensor":
            model["law"] = rng.choice(TENSOR_LAWS) if simplices else "linear"
        case "heml":
            model["law"] = rng.choice(HEML_LAWS) if simplices else "saint-venant-kirchhoff"
        case _:
            model["law"] = rng.choice(list(LAWS))
    if kind == "fem" and rng.random() < 0.4:
        second = [one for one in ELEMENTS if one.startswith("quadratic")]
        model["element"] = rng.choice(["linear", *(second if simplices else ["mean-dilatation"])])
    if model.get("rule") == "gaussian":
        model |= _gaussian(rng, element)
    return model


def _gaussian(rng: random.Random, element: str) -> Tables:
    """Keys of Gaussian springs that go with elements of a kind."""
    if element in HOURGLASS_LIMITS:
        keys: Tables = {"hourglass": rng.uniform(0.6, 1.5), "law": rng.choice(GAUSSIAN_LAWS)}
    else:
        keys = {"law": rng.choice(GAUSSIAN_LAWS)}
        if element in ("triangle", "tetrahedron") and rng.random() < 0.5:
            keys = {"element": "quadratic"}
    return {key: value for key, value in keys.items() if rng.random() < 0.6}


def _compare(rng: random.Random, dim: int, size: list[float], names: list[str]) -> Tables:
    compare: Tables = {"tolerance": rng.choice((0.05, 0.2))}
    if rng.random() < 0.5:
        compare["model"] = rng.choice(names)
    if rng.random() < 0.3:
        compare["references"] = [name for name in names if name != compare.setdefault("model", names[0])][:1]
    if rng.random() < 0.7:
        compare["probe"] = rng.choice(("right-middle", "right-top", "right", list(size)))
    return compare


# --- spoilt ones ----------------------------------------------------------------------------------


def _deep(depth: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(depth):
        value = [value]
    return value


#: Values that no key takes, or few do.
HOSTILE: tuple[Any, ...] = (
    *(0, -1, 1, 2, 3, 7, 10**6, 10**400, -(10**30), True, False),
    *(0.0, -0.0, 1e-300, 1e300, 1e30, 1e-30, 1e29, 1e-29, 1e15, -1e12, 0.5, 0.49999999, 1e-12, -0.99999),
    *(float("nan"), float("inf"), float("-inf")),
    *("", " ", "x", "left", "right", "top", "all", "1", "1 m", "1 mm", "-3 Pa", "1e30 m", "1e300 m", "0 N", "1 N m"),
    *("5 degC", "5 %", "1 m^-9", "1 km^9 km^9 km^9", "1 dB", "1 m/m", "1 rad", "1 year N", "1e5000 m", "٣ mm", "３ mm"),
    *(
        "5 " + "m " * 3000,
        "1" * 50_000 + "x!",
        "1e" + "9" * 300 + " m",
        "9**9**9 m",
        "(" * 60,
        "m" * 40_000,
        "µm",
        "1 µm",
    ),
    *(
        "a\0b",
        "a\nb",
        "\x1b[31mred",
        "a" * 5000,
        "../..",
        ".",
        "/",
        "/nowhere/at/all.msh",
        "con",
        "..",
        "a/b",
        "%s",
        "{x}",
    ),
    *(
        [],
        {},
        [[]],
        [{}],
        {"x": 1},
        {"x": "0 mm"},
        {"near": [0, 0]},
        {"box": [[0, 0], [1, 1]]},
        {"box": []},
        {"near": []},
    ),
    *(
        [0, 0],
        [1.0, 2.0, 3.0],
        ["1 mm", "2 mm"],
        [0],
        ["x"],
        ["x", "x"],
        ["x", ["y"]],
        [True],
        ["left"],
        _deep(15),
        _deep(60),
    ),
    *(
        ["lloyd"],
        {"edge": 1e30},
        {"edge": 1e-30, "diagonal": -1.0},
        {"edge": 0.3, "diagonal": 1e20},
        {"file": "no.csv"},
    ),
    *(
        [1e30] * 2,
        [1e-30] * 3,
        [1e8, 1e-8],
        ["1 mm"] * 100,
        list(range(1000)),
        {"file": "a\0.csv"},
        {"kind": "springs"},
    ),
)


def places(tables: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the way to every value of tables and lists, those that hold others included."""
    inner = tables.items() if isinstance(tables, dict) else enumerate(tables) if isinstance(tables, list) else ()
    for key, value in inner:
        yield (*way, key)
        yield from places(value, (*way, key))


def spoil(rng: random.Random, tables: Tables) -> None:
    """Change one thing in the tables of a study: a value, a key, a table."""
    known = list(places(tables))
    if not known:
        return
    *way, last = rng.choice(known)
    holder: Any = tables
    for part in way:
        holder = holder[part]
    match rng.choice(("scale", "scale", "value", "value", "value", "remove", "wrap", "copy", "add", "swap")):
        case "scale" if isinstance(holder[last], float | int):
            holder[last] *= 10 ** rng.choice((rng.uniform(-3, 3), rng.uniform(-30, 30)))
        case "value":
            holder[last] = copy.deepcopy(rng.choice(HOSTILE))
        case "remove":
            del holder[last]
        case "wrap":
            holder[last] = [holder[last]]
        case "copy":
            other: Any = tables
            for part in rng.choice(known):
                other = other[part]
            holder[last] = copy.deepcopy(other)
        case "add" if isinstance(holder, dict):
            key = rng.choice((*schema.SupportKeys.model_fields, *schema.StudyKeys.model_fields, "x" * 300, "a b", "é"))
            holder[key] = copy.deepcopy(rng.choice(HOSTILE))
        case _:
            if isinstance(holder, dict) and isinstance(last, str):
                holder[last[:-1] + rng.choice("xyz")] = holder.pop(last)


def garbled(rng: random.Random, text: str) -> str:
    """Return a text with some characters changed, cut, or doubled."""
    at = rng.randrange(max(len(text), 1))
    match rng.randrange(5):
        case 0:
            return text[:at]
        case 1:
            return (
                text[:at]
                + rng.choice(('"', "[", "]", "=", "\0", "\x1b", "'''", "#", "{", "\\", "🤷", "\u2028"))
                + text[at:]
            )
        case 2:
            return text[:at] + text[at + rng.randrange(1, 40) :]
        case 3:
            return text + text[at:]
    more = ("[" * 3000, "a." * 3000 + "b = 1", "a = " + "9" * 5000, "[[x]]", "x = 2020-01-01")
    return f"{text[:at]}\n{rng.choice(more)}\n"


# --- what must hold of every one ------------------------------------------------------------------


@dataclass(frozen=True)
class Told:
    """What a command gave: its exit code, standard output and error, and the warnings that Python made on the way."""

    code: int
    output: str
    error: str
    warned: tuple[str, ...]


class Hung(BaseException):
    """A command took too long; no `except Exception` takes it."""


@contextmanager
def _alarm(seconds: int) -> Iterator[None]:
    """Raise Hung after so many seconds of the processor, or many more by the clock where it waits."""

    def ring(*_: Any) -> None:
        raise Hung(f"longer than {seconds} s")

    alarms = ((signal.ITIMER_PROF, signal.SIGPROF, seconds), (signal.ITIMER_REAL, signal.SIGALRM, 15 * seconds))
    before = [(number, signal.signal(number, ring)) for _, number, _ in alarms]
    for timer, _, after in alarms:
        signal.setitimer(timer, after)
    try:
        yield
    finally:
        for timer, _, _ in alarms:
            signal.setitimer(timer, 0)
        for number, handler in before:
            signal.signal(number, handler)


def told(*arguments: object) -> Told:
    """Run a command in this process."""
    output, error = StringIO(), StringIO()
    with warnings.catch_warnings(record=True) as warned, redirect_stdout(output), redirect_stderr(error):
        warnings.simplefilter("always")
        with _alarm(PATIENCE):
            code = main([str(one) for one in arguments])
    return Told(code, output.getvalue(), error.getvalue(), tuple(str(one) for one in warned))


def refuse_constant(word: str) -> None:
    raise AssertionError(f"JSON has no {word}")


def faults(verb: str, text: str, folder: Path) -> list[str]:
    """Run a verb on a study and return what is not as it must be, whatever the study is."""
    file, out = folder / "study.toml", folder / "out"
    file.write_text(text, encoding="utf-8")
    try:
        got = told(verb, file, "--json", *([] if verb == "check" else ["--out", out]))
    except Hung as hung:
        return [f"hung: {hung}"]
    except Exception as raised:
        return [f"raised {type(raised).__name__}: {raised}"]
    found = [f"warned: {one}" for one in got.warned]
    if got.code not in (0, 1, 2, 130):
        found.append(f"exit code {got.code}")
    if "Traceback" in got.error or "internal error" in got.error:
        found.append(f"fault: {got.error}")
    if any(len(line) > 2000 or not line.startswith("truespring: ") for line in got.error.splitlines()):
        found.append(f"standard error: {got.error[:3000]}")
    if got.code == 2:
        found += [] if got.error and not got.output else [f"wrong input: {got.error!r}, {got.output!r}"]
        found += [] if not out.exists() else ["wrong input left an output folder"]
        return found
    if found:
        return found
    summary = json.loads(got.output, parse_constant=refuse_constant)
    if verb == "check":
        return found if got.code == 0 else [*found, f"check ended with {got.code}"]
    return [*found, *_unwhole(summary, out / "study", verb)]


def _unwhole(summary: Tables, folder: Path, verb: str) -> Iterator[str]:
    """What is missing in an output folder, or tells of a fault."""
    written = json.loads((folder / "summary.json").read_text(encoding="utf-8"), parse_constant=refuse_constant)
    if written != summary:
        yield "summary.json is not what was printed"
    for name, model in summary["models"].items():
        for text in model["warnings"]:
            if any(kind in text for kind in OWN_FAULTS):
                yield f"{name}: {text}"
        for wanted in (
            f"{name}.pvd",
            f"deformed_{name}.stl",
            "curves.csv",
            *(["report.html"] if verb == "verify" else []),
        ):
            if not (folder / wanted).is_file():
                yield f"{wanted} is missing"
