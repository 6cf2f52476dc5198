"""Surfaces for viewing: each file is read by other code than its writer, and has the positions of the solution."""

import json
import struct
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from tests.exports import exported, write
from truespring.arrays import Floats
from truespring.exports import Exported, solve_springs, target_files
from truespring.mesh import Mesh

_TYPES = {5121: "u1", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


@cache
def block() -> Exported:
    problem = ts.Problem(
        ts.box(size=(0.08, 0.04, 0.04), elements=(4, 2, 2)),
        ts.Material(10e3, 0.45),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.3, 0.1))],
    )
    return solve_springs(problem, ts.Springs("gaussian"), ts.Newton(load_steps=3), 'A block: "soft" \\ <&>')


def bodies() -> dict[str, Exported]:
    """In space, in the plane, and without elements."""
    return {"block": block(), "strip": exported("bending"), "lines": exported("two springs")}


def in_space(values: Floats) -> Floats:
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))


def levels_of(one: Exported) -> list[Floats]:
    """Positions of all nodes at rest and at each load level, in float32."""
    states = [state.positions for state in one.path.states if state.load_factor > 0]
    return [in_space(places).astype(np.float32) for places in (one.problem.mesh.nodes, *states)]


def surface_nodes(mesh: Mesh) -> Any:
    """The nodes of a block on its faces; all of other bodies."""
    on = (np.abs(mesh.nodes - mesh.lower) < 1e-9) | (np.abs(mesh.nodes - mesh.upper) < 1e-9)
    return np.flatnonzero(on.any(axis=1)) if mesh.dim == 3 else np.arange(mesh.n_nodes)


class Glb:
    """A binary glTF file, read by the layout of the specification alone."""

    def __init__(self, content: bytes) -> None:
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        chunks, at = list[tuple[bytes, bytes]](), 12
        while at < length:
            size, kind = struct.unpack_from("<I4s", content, at)
            assert size % 4 == 0
            chunks.append((kind, content[at + 8 : at + 8 + size]))
            at += 8 + size
        (first, text), (second, self.binary) = chunks
        assert at == length and (first, second) == (b"JSON", b"BIN\0")
        self.json = json.loads(text)
        (buffer,) = self.json["buffers"]
        assert buffer == {"byteLength": len(self.binary)}

    def array(self, number: int) -> Any:
        accessor = self.json["accessors"][number]
        view, dtype = self.json["bufferViews"][accessor["bufferView"]], np.dtype(_TYPES[accessor["componentType"]])
        size = accessor["count"] * _SIZES[accessor["type"]]
        assert view["byteOffset"] % 4 == 0 and view["byteLength"] == size * dtype.itemsize
        values = np.frombuffer(self.binary, dtype, size, view["byteOffset"]).reshape(accessor["count"], -1)
        for key, bound in (("min", values.min(axis=0)), ("max", values.max(axis=0))):
            assert key not in accessor or accessor[key] == bound.tolist()
        return values


@pytest.mark.parametrize("name", ["block", "strip", "lines"])
def test_gltf_has_the_levels_as_morph_targets(name: str) -> None:
    one = bodies()[name]
    content = target_files(one, ["gltf"])["gltf"]["surface.glb"]
    assert isinstance(content, bytes)
    file, levels, chosen = Glb(content), levels_of(one), surface_nodes(one.problem.mesh)
    assert file.json["asset"]["version"] == "2.0" and file.json["asset"]["extras"]["header"][0] == one.title
    (mesh,), (animation,) = file.json["meshes"], file.json["animations"]
    (primitive,) = mesh["primitives"]
    at = primitive["attributes"]["POSITION"]
    assert {"min", "max"} <= file.json["accessors"][at].keys()
    rest = file.array(at)
    assert np.array_equal(rest, levels[0][chosen])
    assert len(primitive["targets"]) == len(mesh["weights"]) == len(levels) - 1 and mesh["weights"][-1] == 1
    for target, places in zip(primitive["targets"], levels[1:], strict=True):
        away = rest + file.array(target["POSITION"]) - places[chosen]
        assert np.abs(away).max() <= 1e-7 * np.abs(places).max()
    colours = file.array(primitive["attributes"]["COLOR_0"])
    assert len(colours) == len(rest) and colours[:, 3].min() == 255
    moved = np.linalg.norm(levels[-1] - levels[0], axis=1)[chosen]
    assert colours[moved.argmax(), 0] > 245 and colours[moved.argmin(), 1] < 3  # bright yellow, dark violet
    indices = file.array(primitive["indices"]).reshape(-1, 2 if name == "lines" else 3)
    assert primitive["mode"] == (1 if name == "lines" else 4)
    assert set(indices.ravel()) == set(range(len(rest)))
    (sampler,), (channel,) = animation["samplers"], animation["channels"]
    assert channel == {"sampler": 0, "target": {"node": 0, "path": "weights"}}
    times = file.array(sampler["input"]).ravel()
    factors = [state.load_factor for state in one.path.states]
    assert times / times[-1] == pytest.approx(np.array([0.0, *[one for one in factors if one > 0]]), rel=1e-6)
    weights = file.array(sampler["output"]).reshape(len(times), -1)
    assert (weights == np.eye(len(times), len(times) - 1, -1)).all()


def test_the_surface_of_a_block_is_closed_and_faces_outwards() -> None:
    """Its volume, by the divergence theorem, is that of the elements, at rest and at full load."""
    one = block()
    content = target_files(one, ["gltf"])["gltf"]["surface.glb"]
    assert isinstance(content, bytes)
    file = Glb(content)
    (primitive,) = file.json["meshes"][0]["primitives"]
    corners = file.array(primitive["attributes"]["POSITION"]).astype(float)[file.array(primitive["indices"]).ravel()]
    volume = np.linalg.det(corners.reshape(-1, 3, 3)).sum() / 6
    assert volume == pytest.approx(0.08 * 0.04 * 0.04, rel=1e-6)


def from_obj(text: str) -> tuple[Floats, list[list[int]]]:
    """Vertices and cells."""
    rows = [line.split() for line in text.splitlines() if not line.startswith("#")]
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], dtype=np.float32)
    return vertices, [[int(one) for one in row[1:]] for row in rows if row[0] in "fl"]


@pytest.mark.parametrize("name", ["block", "strip", "lines"])
def test_obj_files_have_the_positions(name: str) -> None:
    one = bodies()[name]
    levels, chosen = levels_of(one), surface_nodes(one.problem.mesh)
    files = target_files(one, ["obj"], {"levels": True})["obj"]
    assert files.keys() - {"rest.obj", "deformed.obj"} == {f"level_{i}.obj" for i in range(1, len(levels))}
    whole = [files["rest.obj"], *(files[f"level_{i}.obj"] for i in range(1, len(levels)))]
    read = [from_obj(str(text)) for text in whole]
    for (vertices, cells), places in zip(read, levels, strict=True):
        assert np.array_equal(vertices, places[chosen])
        assert cells == read[0][1] and {one for cell in cells for one in cell} == set(range(1, len(vertices) + 1))
    assert np.array_equal(from_obj(str(files["deformed.obj"]))[0], read[-1][0])
    assert target_files(one, ["obj"])["obj"].keys() == {"rest.obj", "deformed.obj"}
    assert f"# {one.title}" in str(files["rest.obj"]).splitlines()


def test_obj_is_read_by_another_program() -> None:
    trimesh = pytest.importorskip("trimesh")
    text = target_files(block(), ["obj"])["obj"]["rest.obj"]
    mesh = trimesh.load(file_obj=trimesh.util.wrap_as_stream(text), file_type="obj", process=False)
    assert mesh.is_watertight and mesh.volume == pytest.approx(0.08 * 0.04 * 0.04, rel=1e-6)


@pytest.mark.parametrize("name", ["block", "strip", "lines"])
def test_usd_has_a_time_sample_of_each_level(name: str, tmp_path: Path) -> None:
    pxr = pytest.importorskip("pxr", reason="usd-core is not installed")
    from pxr import Usd, UsdGeom

    assert pxr
    one = bodies()[name]
    levels, chosen = levels_of(one), surface_nodes(one.problem.mesh)
    stage = Usd.Stage.Open(str(write(target_files(one, ["usd"])["usd"], tmp_path) / "surface.usda"))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1 and one.path.label in stage.GetMetadata("documentation")
    prim = stage.GetDefaultPrim()
    shape = UsdGeom.BasisCurves(prim) if name == "lines" else UsdGeom.Mesh(prim)
    samples = shape.GetPointsAttr().GetTimeSamples()
    assert samples == list(range(len(levels)))
    if name == "lines":
        chosen = one.springs.arrays["springs"].ravel()
    else:
        assert UsdGeom.Mesh.ValidateTopology(
            shape.GetFaceVertexIndicesAttr().Get(), shape.GetFaceVertexCountsAttr().Get(), len(chosen)
        )[0]
    for number, places in zip(samples, levels, strict=True):
        assert np.array_equal(np.array(shape.GetPointsAttr().Get(number)), places[chosen])
        extent = np.array(shape.GetExtentAttr().Get(number))
        assert np.array_equal(extent, [places[chosen].min(axis=0), places[chosen].max(axis=0)])
    assert np.array_equal(np.array(shape.GetPointsAttr().Get()), levels[-1][chosen])
    assert len(shape.GetDisplayColorAttr().Get()) == len(chosen)
