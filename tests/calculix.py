"""Twins of truespring problems for CalculiX: writes the input deck, runs ccx, reads the displacement back.

CalculiX is a finite element program of its own (Dhondt and Wittig, https://www.calculix.de), called as a process.
"""

import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.arrays import Floats
from truespring.loading import nodal_force
from truespring.mesh import facets_within, select
from truespring.models.quadratic import QuadraticPotential
from truespring.potential import Loading

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")

# CalculiX stops by default at a residual of 0.5 % of the mean force and a correction of 1 % of the displacement;
# these are less than it prints.
_CONTROLS = "*CONTROLS, PARAMETERS=FIELD\n1.E-7, 1.E-7"
# It also takes any residual below 1e-6 for zero, whatever the unit: forces are given to it in micronewtons.
_FORCE_UNIT = 1e-6


def continuum_deck(problem: ts.Problem, increments: int | None, element: str = "linear") -> str:
    """Write the elements of first order CPS4 or CPE4 by the section, C3D8, C3D4, or the quadratic C3D10.

    Pressure and gravity are CalculiX's own, other loads come as forces on nodes.
    With `increments` equal load increments NLGEOM makes `*ELASTIC` the St. Venant-Kirchhoff law; None solves linearly.
    """
    assert problem.material is not None and problem.section is not None
    if element == "quadratic":  # of the same order of nodes and four points of integration
        assert problem.mesh.element == "tetrahedron"
        finer = ts.Fem("linear", element).potential(problem)
        assert isinstance(finer, QuadraticPotential)
        kind, nodes, elements, loading = "C3D10", finer.nodes, finer.elements, finer.loading
    else:
        plane = "CPE4" if isinstance(problem.section, ts.PlaneStrain) else "CPS4"
        kind = {"quadrilateral": plane, "hexahedron": "C3D8", "tetrahedron": "C3D4"}[problem.mesh.element]
        nodes, elements, loading = problem.mesh.nodes, problem.mesh.elements, problem.loading
    lines = [
        f"*ELEMENT, TYPE={kind}, ELSET=BODY",
        *(f"{number}, {_joined(one + 1)}" for number, one in enumerate(elements, 1)),
        "*MATERIAL, NAME=M",
        "*ELASTIC",
        f"{_real(problem.material.young / _FORCE_UNIT)}, {_real(problem.material.poisson)}",
        "*SOLID SECTION, ELSET=BODY, MATERIAL=M",
        *([_real(problem.section.thickness)] if problem.mesh.dim == 2 else []),
    ]
    if problem.material.density:
        place = lines.index("*SOLID SECTION, ELSET=BODY, MATERIAL=M")
        lines[place:place] = ["*DENSITY", _real(problem.material.density / _FORCE_UNIT)]
    own = list(_own_loads(problem))
    weight = nodal_force(
        (load.spread(problem.body) for load in problem.loads if isinstance(load, ts.Gravity)), nodes.shape
    )
    rest = replace(loading, external_force=loading.external_force - weight, following=())
    return _deck(nodes, rest, lines, increments, own)


# Corners of CalculiX's faces, in its order, from 0.
_FACES = {
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetrahedron": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}


def _own_loads(problem: ts.Problem) -> Iterator[str]:
    """Pressure on faces, which follows them under NLGEOM, and gravity."""
    mesh = problem.mesh
    for load in problem.loads:
        if isinstance(load, ts.Gravity):
            size = float(np.linalg.norm(load.acceleration))
            direction = [*(np.array(load.acceleration) / size), 0.0][:3]
            yield f"BODY, GRAV, {_real(size)}, {_joined(map(_real, direction))}"
        elif isinstance(load, ts.Pressure):
            pressed = {tuple(sorted(facet)) for facet in facets_within(mesh, select(mesh, load.on)).tolist()}
            for number, corners in enumerate(mesh.elements.tolist(), 1):
                for face, local in enumerate(_FACES[mesh.element], 1):
                    if tuple(sorted(corners[place] for place in local)) in pressed:
                        yield f"{number}, P{face}, {_real(load.pressure / _FORCE_UNIT)}"


def spring_deck(problem: ts.Problem, network: ts.SpringNetwork, increments: int) -> str:
    """Write every spring as a SPRINGA element, one set of elements for each distinct stiffness.

    SPRINGA takes its rest length from the reference positions: the network must be at rest there.
    """
    assert np.allclose(network.stretch(network.nodes), 1.0, rtol=1e-14)
    values, place = np.unique(network.stiffness, return_inverse=True)
    lines = []
    for group, stiffness in enumerate(values):
        lines.append(f"*ELEMENT, TYPE=SPRINGA, ELSET=S{group}")
        members = np.flatnonzero(place == group)
        lines.extend(f"{number + 1}, {_joined(network.springs[number] + 1)}" for number in members)
        # The empty line stands for directions; stiffness without a decimal point would be read as one.
        lines.extend([f"*SPRING, ELSET=S{group}", "", _real(stiffness / _FORCE_UNIT)])
    if problem.mesh.dim == 2:  # CalculiX is three-dimensional: the plane is held in z
        lines += ["*BOUNDARY", "NALL, 3, 3"]
    return _deck(problem.mesh.nodes, problem.loading, lines, increments)


def displacement(deck: str, folder: Path) -> Floats:
    """Run `deck` in `folder` and return the displacement at the end of its step [m], shape (n_nodes, 3)."""
    (folder / "twin.inp").write_text(deck)
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        ["ccx", "twin"], cwd=folder, env=environment, capture_output=True, text=True, timeout=600, check=False
    )
    printed = folder / "twin.dat"
    # Of a wrong deck ccx leaves an empty file.
    assert done.returncode == 0 and printed.is_file() and printed.stat().st_size, done.stdout[-2000:]
    return _last_block(printed.read_text())


def _deck(
    nodes: Floats, loading: Loading, model: list[str], increments: int | None, own_loads: Sequence[str] = ()
) -> str:
    motion = loading.motion()
    return "\n".join(
        [
            "*NODE, NSET=NALL",
            *(f"{number}, {_joined(map(_real, node))}" for number, node in enumerate(nodes, 1)),
            *model,
            "*STEP" if increments is None else f"*STEP, NLGEOM, INC={increments}",
            *(["*STATIC"] if increments is None else [_CONTROLS, "*STATIC, DIRECT", f"{_real(1 / increments)}, 1."]),
            "*BOUNDARY",
            *(
                f"{node + 1}, {axis + 1}, {axis + 1}, {_real(motion[node, axis])}"
                for node, axis in np.argwhere(loading.held)
            ),
            *_loads(loading.external_force),
            *(["*DLOAD", *own_loads] if own_loads else []),
            f"*NODE PRINT, NSET=NALL, FREQUENCY={increments or 1}",
            "U",
            "*END STEP",
            "",
        ]
    )


def _loads(force: Floats) -> Iterator[str]:
    if force.any():
        yield "*CLOAD"
        for node, axis in np.argwhere(force):
            yield f"{node + 1}, {axis + 1}, {_real(force[node, axis] / _FORCE_UNIT)}"


def _real(value: float) -> str:
    """At most 19 characters: ccx reads twenty of a number and silently drops the rest."""
    return f"{value:.12e}"


def _joined(values: Iterable[object]) -> str:
    return ", ".join(map(str, values))


def _last_block(printed: str) -> Floats:
    """Read the last table of a .dat file: node, vx, vy, vz."""
    table = printed[printed.rindex("displacements") :].splitlines()[1:]
    rows = np.array([line.split() for line in table if line.strip()], dtype=float)
    assert (rows[:, 0] == np.arange(1, len(rows) + 1)).all()
    return rows[:, 1:]
