"""Measure the stiffness of Gaussian springs against `hourglass`, and write docs/hourglass.json and docs/hourglass.md.

Each value is the relative error of the stiffness of a clamped bar at small load, against finite elements refined and
extrapolated on the same geometry: bending and stretching by a force on the other end, shear by moving that end without
rotation, torsion by turning it.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import truespring as ts
from truespring.linear.choice import choose
from truespring.models.model import Model

DOCS = Path(__file__).parent
LENGTH = 4  # over the depth
HOURGLASS = (0.6, 0.8, 0.9, 1.0, 1.2, 1.333, 1.5)
POISSON = (0.0, 0.3, 0.45, 0.49)
LOADS = ("bending", "stretching", "shear", "torsion")
ACCURACY = 1e-9


@dataclass(frozen=True)
class Body:
    """A bar of unit depth: its words, its mesh by the number of elements through the depth, and the depths measured."""

    words: str
    mesh: Callable[[int], ts.Mesh]
    section: ts.PlaneStress | ts.PlaneStrain | None
    depths: tuple[int, ...]
    finest: int

    @property
    def loads(self) -> tuple[str, ...]:
        return LOADS if self.section is None else LOADS[:3]


def _squares(depth: int) -> ts.Mesh:
    return ts.rectangle((LENGTH, 1.0), (LENGTH * depth, depth))


def _cubes(depth: int) -> ts.Mesh:
    return ts.box((LENGTH, 1.0, 1.0), (LENGTH * depth, depth, depth))


def _bricks(depth: int) -> ts.Mesh:
    """Return bricks twice as long as deep and wide."""
    return ts.box((LENGTH, 1.0, 1.0), (LENGTH * depth // 2, depth, depth))


def _rod(depth: int) -> ts.Mesh:
    """Return the cubes of a round rod of four cubes across, each divided into depth / 4 along its edges."""
    whole = _cubes(depth)
    coarse = np.floor(whole.centres * 4 - 1e-9) + 0.5
    inside = np.hypot(coarse[:, 1] - 2, coarse[:, 2] - 2) < 1.9
    used, numbers = np.unique(whole.elements[inside], return_inverse=True)
    return ts.Mesh(whole.nodes[used], numbers.reshape(-1, 8), "hexahedron")


BODIES = {
    "squares": Body("squares, plane stress", _squares, ts.PlaneStress(1.0), (1, 2, 4, 8), 64),
    "squares-strain": Body("squares, plane strain", _squares, ts.PlaneStrain(1.0), (1, 2, 4, 8), 64),
    "cubes": Body("cubes", _cubes, None, (1, 2, 4, 8), 16),
    "bricks": Body("bricks twice as long as deep", _bricks, None, (2, 4, 8), 16),
    "voxels": Body("a round rod of cubes", _rod, None, (4, 8), 16),
}


def main() -> None:
    found = [
        {"body": name, "poisson": poisson, "depth": depth, "load": load, "values": _errors(name, poisson, depth, load)}
        for name, body in BODIES.items()
        for poisson in POISSON
        for depth in body.depths
        for load in body.loads
    ]
    (DOCS / "hourglass.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    (DOCS / "hourglass.md").write_text(page(found), encoding="utf-8")


def _errors(name: str, poisson: float, depth: int, load: str) -> dict[str, float]:
    """Return the relative errors of the stiffness by value of `hourglass`, and that of finite elements."""
    exact = _exact(name, poisson, load)
    models = {f"{value:g}": ts.Springs("gaussian", hourglass=value) for value in HOURGLASS}
    found = {key: _stiffness(name, poisson, depth, load, model) / exact - 1 for key, model in models.items()}
    print(name, poisson, depth, load, {key: round(100 * value, 2) for key, value in found.items()}, flush=True)
    return found | {"fem": _stiffness(name, poisson, depth, load, ts.Fem("linear")) / exact - 1}


@cache
def _exact(name: str, poisson: float, load: str) -> float:
    """Return the stiffness on fine meshes, extrapolated with the order observed on three."""
    fine = BODIES[name].finest
    a, b, c = (_stiffness(name, poisson, fine // part, load, ts.Fem("linear")) for part in (4, 2, 1))
    ratio = (a - b) / (b - c)
    return c - (b - c) / (ratio - 1) if 1.5 < ratio < 8 else c - (b - c) / 3


@cache
def _stiffness(name: str, poisson: float, depth: int, load: str, model: Model) -> float:
    """Return force over mean displacement, or twice the energy of a unit motion [N/m]."""
    body = BODIES[name]
    mesh = body.mesh(depth)
    problem = _problem(mesh, poisson, body.section, load)
    K, loading = model.potential(problem).hessian(mesh.nodes), problem.loading
    motion = loading.motion(1e-6) * 1e6
    right = loading.external_force - (K @ motion.ravel()).reshape(motion.shape)
    tangent = choose("auto", mesh.nodes, loading.held).ready(K, mesh.nodes)
    moved = tangent.solve(np.where(loading.held, 0.0, right), ACCURACY).reshape(motion.shape) + motion
    work = float((loading.external_force * moved).sum())
    return 1 / work if work else float(moved.ravel() @ (K @ moved.ravel()))


def _problem(mesh: ts.Mesh, poisson: float, section: ts.PlaneStress | ts.PlaneStrain | None, load: str) -> ts.Problem:
    """Return a bar of unit Young's modulus, clamped at the left end."""
    held, across = ts.Fixed(on="left"), (0.0,) * (mesh.dim - 1)
    material = ts.Material(1.0, poisson)
    if load in ("bending", "stretching"):
        total = (1.0, *across) if load == "stretching" else (0.0, 1.0, *across[1:])
        return ts.Problem(mesh, material, section, [held], [ts.Force(on="right", total=total)])
    moved = ts.Fixed(on="right", displacement=(0.0, 1.0, *across[1:]))
    if load == "torsion":
        moved = ts.Fixed(on="right", rotation=1.0, axis=(1.0, 0.0, 0.0))
    return ts.Problem(mesh, material, section, [held, moved])


def page(found: list[dict]) -> str:
    """Return docs/hourglass.md from the measured values."""
    rows = [("elements", "default of `hourglass`", "reason"), ("---",) * 3, *DEFAULTS]
    parts = [INTRODUCTION.replace("{defaults}", "\n".join(f"| {' | '.join(row)} |" for row in rows))]
    for name, body in BODIES.items():
        parts.append(f"## {body.words[0].upper()}{body.words[1:]}\n")
        for load in body.loads:
            parts += [f"{load.capitalize()}, error of the stiffness in %:\n", _table(found, name, load)]
    return "\n".join(parts)


def _table(found: list[dict], name: str, load: str) -> str:
    """Return a Markdown table of the errors of one body under one load: a row for each Poisson's ratio and depth."""
    rows = [one for one in found if one["body"] == name and one["load"] == load]
    keys = list(rows[0]["values"])
    head = ["nu", "elements deep", *(key if key != "fem" else "linear FEM" for key in keys)]
    lines = [head, ["---:"] * len(head)]
    for one in rows:
        cells = [f"{100 * one['values'][key]:+.1f}" for key in keys]
        lines.append([f"{one['poisson']:g}", str(one["depth"]), *cells])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


DEFAULTS = (
    (
        "quadrilaterals",
        "1",
        "within 1.5 % under all loads from 4 elements deep on; at 2 deep in plane stress, 1 + nu is better in bending "
        "and worse in shear",
    ),
    (
        "hexahedra",
        "1 / (1 + nu^2)",
        "within 2 % in bending from 2 elements deep on at any nu; at 1, torsion is 5 % too stiff at 4 deep, and "
        "less is better still",
    ),
    (
        "equal bricks that do not fill their bounding box, such as voxels",
        "1.2",
        "on the rods below, 1 / (1 + nu^2) is nearer; but on an organ of voxels at nu = 0.49, corners of single cubes "
        "turn inside out at 0.81, and multigrid converges from 1.2 on",
    ),
    ("wedges, pyramids", "always 1", "below about 0.6, a wedge has a mode without stiffness"),
    ("triangles, tetrahedra", "none", "they have no hourglass modes"),
)

INTRODUCTION = f"""# The hourglass stiffness of Gaussian springs

An element with more nodes than a simplex has hourglass modes: motions that no uniform strain contains. Their stiffness
is free, since uniform strain does not depend on it. The key `hourglass` of `rule = "gaussian"` is that stiffness over
the stiffness of finite elements with full integration; its closed forms are in [models.md](models.md).

The tables show what it changes: the error of the stiffness of a bar of length {LENGTH} and depth 1, clamped at one end,
under a small load. Bending and stretching are by a force on the other end, shear by moving that end sideways without
rotation, torsion by turning it. The truth is finite elements of {BODIES["cubes"].finest} elements through the depth
({BODIES["squares"].finest} in the plane), extrapolated with the order observed on three meshes. Columns are values of
`hourglass`; the last is linear finite elements with full integration, and from nu = 0.45 on in plane strain and in
space with mean dilatation, since full integration locks near nu = 1/2. `make hourglass` measures them again.

## The default

{{defaults}}

Bricks twice as long as deep are better at 0.6 to 0.8 in bending and shear, and at 0.9 in torsion. One element deep, no
value is right for all loads: use two elements or more through the depth.
"""


if __name__ == "__main__":
    main()
