"""Decks of one element of each kind, and CalculiX run on them as by hand."""

import os
import subprocess
from pathlib import Path

import numpy as np

from truespring.mesh.cells import CELL_SHAPES

# By CalculiX's name: meshio's, whose nodes stand in the order of the deck.
ELEMENTS = {
    "CPS3": "triangle",
    "CPS6": "triangle6",
    "CPS4": "quad",
    "CPE8": "quad8",
    "C3D4": "tetra",
    "C3D10": "tetra10",
    "C3D6": "wedge",
    "C3D15": "wedge15",
    "C3D8": "hexahedron",
    "C3D20": "hexahedron20",
}
FORCE = (0.06, -0.04, 0.02)


def element_deck(
    kind: str, output: str = "*NODE FILE\nU\n", last: str = "", nlgeom: str = ", NLGEOM", loose: bool = False
) -> str:
    """Write one element, held where its last coordinate is 0 and pulled at one node, in two increments and a step.

    A C3D6 has two points of integration only: it is held at two nodes more, unless it is `loose`.
    """
    shape = CELL_SHAPES[ELEMENTS[kind]]
    places = np.zeros((len(shape.places), 3))
    places[:, : shape.dim] = shape.places * [2.0, 1.0, 1.5][: shape.dim]
    held = np.flatnonzero(places[:, shape.dim - 1] == 0) + 1
    if kind == "C3D6" and not loose:
        held = np.array([1, 2, 3, 5, 6])
    pulled = int(places[:, shape.dim - 1].argmax()) + 1
    lines = [
        "*NODE, NSET=NALL",
        *(f"{number}, {x}, {y}, {z}" for number, (x, y, z) in enumerate(places.tolist(), 1)),
        f"*ELEMENT, TYPE={kind}, ELSET=BODY",
        *_wrapped([1, *range(1, len(places) + 1)]),
        "*NSET, NSET=HELD",
        *_wrapped(held.tolist()),
        "*MATERIAL, NAME=M\n*ELASTIC\n100., 0.3\n*DENSITY\n1.\n*SOLID SECTION, ELSET=BODY, MATERIAL=M",
        *(["0.5"] if shape.dim == 2 else []),
        "*BOUNDARY\nHELD, 1, 3",
    ]
    for step, scale in enumerate((1.0, 2.0)):
        pull = "\n".join(f"{pulled}, {axis + 1}, {scale * FORCE[axis]}" for axis in range(shape.dim))
        increments = "*STATIC, DIRECT\n0.5, 1." if nlgeom and not step else "*STATIC"
        lines.append(
            f"*STEP{nlgeom}\n{increments}\n*CLOAD, OP=NEW\n{pull}\n{output}*NODE PRINT, NSET=NALL\nU\n{last}*END STEP"
        )
    return "\n".join(lines) + "\n"


def _wrapped(numbers: list[int]) -> list[str]:
    """Eight numbers a line, as CalculiX takes at most sixteen."""
    rows = [numbers[place : place + 8] for place in range(0, len(numbers), 8)]
    return [",".join(map(str, row)) + ("," if row is not rows[-1] else "") for row in rows]


def run(deck: str, folder: Path, stem: str = "body", fails: bool = False) -> Path:
    """Run CalculiX on a deck in a folder and return the path of its files without a suffix."""
    (folder / f"{stem}.inp").write_text(deck)
    done = subprocess.run(
        ["ccx", stem],
        cwd=folder,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert bool(done.returncode) == fails, done.stdout[-2000:]
    return folder / stem
