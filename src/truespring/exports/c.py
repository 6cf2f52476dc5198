"""The C runtime: a header in C99 that moves a body, and the body as one data file."""

import re
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from truespring.arrays import in_space
from truespring.exports.c_groups import Group, groups_of
from truespring.exports.exported import Exported
from truespring.exports.moved import Moved

#: Version of the data, as in truespring.h.
VERSION = 1
_SOURCES = Path(__file__).parent / "runtime"


def c(exported: Exported) -> Mapping[str, str | bytes]:
    """Return truespring.h, body.bin, and main.c, which settles the body."""
    moved = Moved(exported)
    header, main = ((_SOURCES / name).read_text(encoding="utf-8") for name in ("truespring.h", "main.c"))
    words = (*exported.header, *moved.words)
    about = "".join(f"/* {_comment(line)} */\n" for line in words)
    return {"truespring.h": f"{about}\n{header}", "body.bin": data_of(moved), "main.c": main}


def _comment(line: str) -> str:
    """Return a line without signs that end a comment, begin one, or continue a line."""
    return re.sub(r"\*(?=/)|/(?=\*)", r"\g<0> ", line).replace("\\", "/").replace("??", "?")


def data_of(moved: Moved) -> bytes:
    """Return the data: a head of 32 bytes with a checksum, numbers, arrays of nodes, and groups; little-endian."""
    exported, loading, (touched, areas) = moved.exported, moved.loading, moved.surface
    nodes, groups, state = moved.nodes, list(groups_of(exported)), exported.state
    young = max((one.young for one in exported.problem.materials), default=0.0)
    thickness = 1.0 if exported.problem.section is None else exported.problem.section.thickness
    counts = (
        len(nodes),
        nodes.shape[1],
        len(touched),
        len(groups),
        exported.probe,
        moved.ramp,
        int(state is not None),
        0,
    )
    bits = (loading.held * 2 ** np.arange(nodes.shape[1])).sum(axis=1)
    bits = bits | (4 if nodes.shape[1] == 2 else 0)
    content = b"".join(
        [
            struct.pack("<8I", *counts),
            struct.pack("<4d", moved.stable, moved.patch, young, thickness),
            _values(in_space(nodes)),
            _values(moved.mass),
            _values(in_space(exported.force_of(loading))),
            _values(in_space(loading.full.motion())),
            _numbers(bits),
            _numbers(touched),
            _values(areas),
            b"" if state is None else _values(in_space(state.all_positions)),
            *map(_group, groups),
        ]
    )
    head = struct.pack("<8sII", b"TRSPRING", 0x01020304, VERSION)
    return head + struct.pack("<QQ", len(content) + 32, zlib.crc32(content)) + content


def _group(group: Group) -> bytes:
    counts = (
        group.kind,
        *group.nodes.shape,
        group.law,
        int(group.sheet),
        group.form,
        len(group.simplices),
        len(group.links),
        group.points,
        group.matrices,
    )
    arrays = [_numbers(group.nodes), _numbers(group.simplices), _numbers(group.links), *map(_values, group.values)]
    return struct.pack("<10Id", *counts, group.scale) + b"".join(arrays)


def _numbers(values: Any) -> bytes:
    """Return numbers of 32 bits, with zeros up to a multiple of 8 bytes."""
    found = np.ascontiguousarray(values, dtype="<u4").tobytes()
    return found + b"\0" * (-len(found) % 8)


def _values(values: Any) -> bytes:
    return np.ascontiguousarray(values, dtype="<f8").tobytes()
