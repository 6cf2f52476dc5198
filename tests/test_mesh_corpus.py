"""Meshes that others made, where they are found: size, elements and sets are those that a few lines count."""

import gzip
import importlib.util
import shutil
import subprocess
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh.files import FORMATS, read_mesh

pytestmark = pytest.mark.verification

# gmsh's tutorials that mesh a body of one kind of element in a few seconds, and how many elements need it at least.
TUTORIALS = {"t1": 300, "t2": 1000, "t4": 700, "t6": 300, "t7": 1500, "t8": 300, "t15": 200, "t20": 2000, "t21": 900}
PLACES = [Path(f"/usr/share/doc/{name}") for name in ("gmsh-doc", "gmsh")]
CORNERS = {1: 2, 2: 3, 3: 4, 4: 4, 15: 1}
DIMENSION = {1: 1, 2: 2, 3: 2, 4: 3, 15: 0}

# Packages that hold meshes, and how many of them are read at least.
PACKAGES = {"pyvista": 1}


def counted(file: Path) -> tuple[int, float, dict[str, int]]:
    """The elements of the highest dimension in a text of version 2.2, their size, and the nodes of its named groups."""
    lines = file.read_text().splitlines()

    def section(name: str) -> list[list[str]]:
        begin = lines.index(f"${name}") + 2 if f"${name}" in lines else 0
        return [line.split(maxsplit=2) if name == "PhysicalNames" else line.split() for line in lines[begin:]][
            : int(lines[begin - 1]) if begin else 0
        ]

    places = {row[0]: np.array(row[1:4], dtype=float) for row in section("Nodes")}
    names = {(int(dim), int(tag)): name.strip('"') for dim, tag, name in section("PhysicalNames")}
    cells: dict[int, set[tuple[str, ...]]] = defaultdict(set)
    groups: dict[str, set[str]] = defaultdict(set)
    for _, kind, n_tags, group, *rest in section("Elements"):
        dim, nodes = DIMENSION[int(kind)], tuple(rest[int(n_tags) - 1 :][: CORNERS[int(kind)]])
        cells[dim].add(nodes)
        groups[names.get((dim, int(group)), group)].update(nodes)
    body = cells[max(cells)]
    used = {node for nodes in body for node in nodes}
    whole = sum(size(np.array([places[node] for node in nodes])) for nodes in body)
    return len(body), whole, {name: len(of & used) for name, of in groups.items() if name != "0" and of & used}


def size(corners: Floats) -> float:
    """The area of a triangle or quadrilateral in the plane, the volume of a tetrahedron."""
    if len(corners) == 4 and np.ptp(corners[:, 2]) > 0:
        return abs(float(np.linalg.det(corners[1:] - corners[0]))) / 6
    x, y, _ = corners.T
    return abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())) / 2


@pytest.mark.skipif(shutil.which("gmsh") is None, reason="gmsh is not installed")
@pytest.mark.parametrize("name", TUTORIALS)
def test_tutorials_of_gmsh_in_every_format(name: str, tmp_path: Path) -> None:
    folder = next((file.parent for place in PLACES for file in place.rglob("t1.geo*")), None)
    if folder is None:
        pytest.skip("gmsh's tutorials are not installed")
    for file in folder.iterdir():
        if file.suffix == ".gz":
            (tmp_path / file.stem).write_bytes(gzip.decompress(file.read_bytes()))
        elif file.is_file():
            shutil.copy(file, tmp_path)

    def gmsh(*arguments: str) -> None:
        subprocess.run(["gmsh", *arguments, "-v", "0"], cwd=tmp_path, check=True, timeout=120)

    gmsh(f"{name}.geo", "-3", "-format", "msh41", "-o", "made.msh")
    gmsh("made.msh", "-0", "-format", "msh22", "-o", "22.msh")
    gmsh("made.msh", "-0", "-format", "msh41", "-bin", "-o", "41_binary.msh")
    gmsh("made.msh", "-0", "-format", "msh22", "-bin", "-o", "22_binary.msh")
    gmsh("made.msh", "-0", "-format", "msh40", "-o", "40.msh")
    n_elements, whole, groups = counted(tmp_path / "22.msh")
    assert n_elements >= TUTORIALS[name]
    for file in sorted(tmp_path.glob("*.msh")):
        if file.name == "view5.msh":
            continue
        mesh = read_mesh(file)
        assert len(mesh.elements) == n_elements, file.name
        assert mesh.measures.sum() == pytest.approx(whole, rel=1e-9), file.name
        assert {group: len(nodes) for group, nodes in mesh.node_groups.items()} == groups, file.name
        for facets in mesh.facet_groups.values():
            assert len(np.unique(np.sort(mesh.facet_nodes(facets), axis=1), axis=0)) == len(facets)


@pytest.mark.parametrize("package", PACKAGES)
def test_meshes_inside_packages(package: str) -> None:
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        pytest.skip(f"{package} is not installed")
    pyvista = pytest.importorskip("pyvista")
    n_read = 0
    for file in sorted(Path(found.origin).parent.rglob("*")):
        if file.suffix.lower() not in FORMATS or not file.is_file():
            continue
        try:
            mesh = read_mesh(file)
        except MeshError as error:
            assert str(error).startswith(str(file)) and len(str(error)) > len(str(file)) + 20
            continue
        n_read += 1
        theirs = pyvista.read(file)
        solid = theirs.extract_cells([cell for cell in range(theirs.n_cells) if theirs.get_cell(cell).dimension > 1])
        assert len(mesh.elements) == solid.n_cells
        assert mesh.measures.sum() == pytest.approx(solid.volume if mesh.dim == 3 else solid.area)
    assert n_read >= PACKAGES[package]
