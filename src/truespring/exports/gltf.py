"""glTF 2.0 in one binary file: the surface with a morph target for each load level, and an animation through them.

Source: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

import json
import struct
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from truespring.exports.exported import Exported
from truespring.exports.shown import SECONDS, Shown

# Numbers of the specification: component types, targets of buffer views, modes of primitives, kinds of chunks.
_BYTE, _INDEX, _FLOAT = 5121, 5125, 5126
_VERTICES, _INDICES = 34962, 34963
_LINES, _TRIANGLES = 1, 4
_MAGIC, _JSON, _BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942


def gltf(exported: Exported) -> Mapping[str, str | bytes]:
    """Return surface.glb."""
    shown, buffer = Shown(exported), _Buffer()
    (_, rest), *levels = shown.levels
    attributes = {"POSITION": buffer.add(rest, "VEC3", _VERTICES, bounds=True)}
    colours = np.concatenate([shown.linear_colours, np.ones((len(rest), 1))], axis=1)
    attributes["COLOR_0"] = buffer.add(np.rint(255 * colours).astype(np.uint8), "VEC4", _VERTICES, normalized=True)
    primitive: dict[str, Any] = {
        "attributes": attributes,
        "indices": buffer.add(shown.rows.ravel().astype(np.uint32), "SCALAR", _INDICES),
        "mode": _LINES if shown.is_lines else _TRIANGLES,
        "material": 0,
    }
    mesh: dict[str, Any] = {"primitives": [primitive]}
    scene: dict[str, Any] = {
        "asset": {
            "version": "2.0",
            "generator": f"truespring {version('truespring')}",
            "extras": {"header": list(exported.header)},
        },
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": exported.path.label}],
        "meshes": [mesh],
        "materials": [
            {
                "doubleSided": True,
                "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.8},
            }
        ],
    }
    if levels:
        primitive["targets"] = [
            {"POSITION": buffer.add(places - rest, "VEC3", _VERTICES, bounds=True)} for _, places in levels
        ]
        mesh["weights"] = [0.0] * (len(levels) - 1) + [1.0]
        mesh["extras"] = {"targetNames": [f"load factor {factor:.6g}" for factor, _ in levels]}
        scene["animations"] = [_animation(buffer, [factor for factor, _ in levels])]
    return {"surface.glb": buffer.file(scene)}


def _animation(buffer: "_Buffer", factors: list[float]) -> dict[str, Any]:
    """Return the animation from rest through the morph targets, its time proportional to the load factor.

    If the load factor decreases on the way, levels follow each other in equal times.
    """
    times = np.array([0.0, *factors])
    if not (np.diff(times) > 0).all():
        times = np.arange(len(times), dtype=float)
    weights = np.eye(len(times), len(factors), -1, dtype=np.float32)
    sampler = {
        "input": buffer.add((SECONDS * times / times[-1]).astype(np.float32), "SCALAR", bounds=True),
        "output": buffer.add(weights.ravel(), "SCALAR"),
        "interpolation": "LINEAR",
    }
    return {
        "name": "load",
        "samplers": [sampler],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
    }


class _Buffer:
    """The binary part of a file, with its views and accessors; one view for each array."""

    def __init__(self) -> None:
        self.content, self.views, self.accessors = bytearray(), list[dict[str, Any]](), list[dict[str, Any]]()

    def add(
        self,
        values: np.ndarray[Any, Any],
        kind: str,
        target: int | None = None,
        bounds: bool = False,
        normalized: bool = False,
    ) -> int:
        """Append an array; return the number of its accessor."""
        content = np.ascontiguousarray(values).tobytes()
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.content), "byteLength": len(content)}
        self.views.append(view if target is None else view | {"target": target})
        self.content += content + bytes(-len(content) % 4)
        accessor: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": {"f": _FLOAT, "u": _INDEX if values.itemsize == 4 else _BYTE}[values.dtype.kind],
            "count": len(values),
            "type": kind,
        }
        if bounds:
            rows = values.reshape(len(values), -1)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self.accessors.append(accessor | ({"normalized": True} if normalized else {}))
        return len(self.accessors) - 1

    def file(self, scene: Mapping[str, Any]) -> bytes:
        """Return the file: a header of 12 bytes, then the chunks of JSON and of the arrays, each padded to 4 bytes."""
        whole = {
            **scene,
            "buffers": [{"byteLength": len(self.content)}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        }
        text = json.dumps(whole, allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), _JSON) + text
        chunks += struct.pack("<II", len(self.content), _BINARY) + self.content
        return struct.pack("<III", _MAGIC, 2, 12 + len(chunks)) + chunks
