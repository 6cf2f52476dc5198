"""A public corpus of decks: what is read of each is what a few lines of another kind count."""

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh.files.inp import read_inp

CORPUS = Path("/usr/share/doc/calculix-ccx-test/examples/test")
# Of the 155 decks of version 2.11 these have a body; the others have pipes, beams, shells in space or turned bodies.
N_BODIES = 65
NO_BODY = r"none; a body consists of|there are only|a shell is not supported|axisymmetric, |no \*NODE|wedge"

FACES = {8: ("3210", "4567", "0154", "1265", "2376", "3047"), 6: ("021", "345", "0143", "1254", "2035")}


class Counted(NamedTuple):
    """Elements, nodes at their corners, area or volume, and how many of these nodes each node set has."""

    n_elements: int
    n_nodes: int
    size: float
    sets: dict[str, int]


def counted(text: str) -> Counted:
    """Count a flat deck of hexahedra, wedges or quadrilaterals in the plane."""
    text = re.sub(r"(?m)^\*\*.*\n|^[ \t]*\n", "", text.replace("\r", ""))
    nodes: dict[int, Floats] = {}
    cells: dict[bool, list[tuple[int, ...]]] = {True: [], False: []}  # by whether they are solid
    sets: dict[str, set[int]] = {"": set()}
    for head, body in re.findall(r"(?m)^(\*[^\n]*)\n((?:[^*][^\n]*\n?)*)", text):
        keyword, *parameters = (one.strip().upper() for one in head.split(","))
        given = dict(re.split(r"\s*=\s*", one) for one in parameters if "=" in one)
        rows = [[one.strip().upper() for one in line.split(",") if one.strip()] for line in body.splitlines()]
        if keyword == "*NODE":
            for number, *at in rows:
                nodes[int(number)] = np.array([*(float(one.replace("D", "E")) for one in at), 0.0, 0.0, 0.0][:3])
                sets.setdefault(given.get("NSET", ""), set()).add(int(number))
        elif keyword == "*ELEMENT" and (type_ := re.match(r"(C3D|CPS|CPE|S|M3D)(\d+)", given["TYPE"])):
            is_solid, n_nodes = type_[1] == "C3D", int(type_[2])
            n_corners = 6 if n_nodes in (6, 15) and is_solid else 8 if is_solid else 4
            numbers = [int(one) for row in rows for one in row]
            starts = range(1, len(numbers), n_nodes + 1)
            cells[is_solid] += [tuple(numbers[at : at + n_corners]) for at in starts]
        elif keyword == "*NSET":
            there = sets.setdefault(given["NSET"], set())
            for row in rows:
                if "GENERATE" in parameters:
                    there.update(range(int(row[0]), int(row[1]) + 1, int([*row, "1"][2])))
                else:
                    there.update(*({int(one)} if one.isdigit() else sets[one] for one in row))
    is_solid = bool(cells[True])
    used = {node for cell in cells[is_solid] for node in cell}
    size = sum((volume if is_solid else area)(np.array([nodes[node] for node in cell])) for cell in cells[is_solid])
    groups = {name: len(of & used) for name, of in sets.items() if name and of & used}
    return Counted(len(cells[is_solid]), len(used), abs(size), groups)


def volume(corners: Floats) -> float:
    """By the divergence theorem, each face a fan about its middle."""
    size = 0.0
    for face in FACES[len(corners)]:
        at = corners[[int(one) for one in face]]
        size += sum(at.mean(axis=0) @ np.cross(a, b) for a, b in zip(at, np.roll(at, -1, axis=0), strict=True)) / 6
    return float(size)


def area(corners: Floats) -> float:
    """By the shoelace formula."""
    x, y = corners[:, 0], corners[:, 1]
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


@pytest.mark.verification
def test_each_deck_is_read_as_counted() -> None:
    """Debian's package calculix-ccx-test."""
    decks = sorted(CORPUS.glob("*.inp"))
    if not decks:
        pytest.skip("there is no corpus: install Debian's package calculix-ccx-test")
    n_read = 0
    for file in decks:
        try:
            mesh = read_inp(file.read_bytes(), CORPUS).mesh(1.0, join=False)
        except MeshError as error:
            assert re.search(NO_BODY, str(error)), f"{file.name}: {error}"
            continue
        n_read += 1
        wanted = counted(file.read_text(encoding="latin-1"))
        assert (len(mesh.elements), mesh.n_nodes) == wanted[:2], file.name
        assert math.isclose(mesh.measures.sum(), wanted.size, rel_tol=1e-9), file.name
        groups = {name.upper(): len(nodes) for name, nodes in mesh.node_groups.items()}
        assert {name: groups.get(name) for name in wanted.sets} == wanted.sets, file.name
    assert n_read >= N_BODIES
