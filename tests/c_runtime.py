"""truespring.h, compiled and called, and a second reader of its data."""

import ctypes
import shutil
import struct
import subprocess
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pytest

from truespring.arrays import Floats
from truespring.exports import Exported, target_files

SOURCES = Path(__file__).parent / "c"
FLAGS = ("-O2", "-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic")
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler: cc is not installed")


def files_of(one: Exported) -> dict[str, Any]:
    return dict(target_files(one, ["c"])["c"])


def data_of(one: Exported) -> bytes:
    return bytes(files_of(one)["body.bin"])


def compiled(header: str, source: str, folder: Path, *flags: str, compiler: str = "cc") -> Path:
    """Compile a source beside the header, without warnings."""
    (folder / "truespring.h").write_text(header, encoding="utf-8")
    (folder / "source.c").write_text(source, encoding="utf-8")
    command = [compiler, *flags, str(folder / "source.c"), "-o", str(folder / "program"), "-lm"]
    if "-fsyntax-only" in flags:
        command = [compiler, *flags, str(folder / "source.c")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return folder / "program"


@cache
def _library(header: str, real: str) -> ctypes.CDLL:
    folder = Path(mkdtemp())
    driver = (SOURCES / "driver.c").read_text(encoding="utf-8")
    library = ctypes.CDLL(
        str(compiled(header, driver, folder, *FLAGS, "-fPIC", "-shared", f"-DTRUESPRING_REAL={real}"))
    )
    shutil.rmtree(folder)
    doubles = ("step_length", "stable_step", "patch", "time", "energy", "kinetic_energy", "force", "seconds")
    for name in doubles:
        getattr(library, f"driver_{name}").restype = ctypes.c_double
    for name in ("open", "positions", "velocities", "loads", "masses", "grip_force", "sphere_force"):
        getattr(library, f"driver_{name}").restype = ctypes.c_void_p
    library.driver_text.restype = ctypes.c_char_p
    return library


def library(real: str = "double") -> ctypes.CDLL:
    import truespring.exports.c as room

    return _library((Path(room.__file__).parent / "runtime" / "truespring.h").read_text(encoding="utf-8"), real)


def error_of(data: bytes) -> tuple[int, str]:
    """The code with which data is opened, and its text."""
    error = ctypes.c_int()
    lib = library()
    one = lib.driver_open(data, ctypes.c_size_t(len(data)), ctypes.byref(error))
    lib.driver_close(ctypes.c_void_p(one))
    return error.value, lib.driver_text(error.value).decode()


class Body:
    """A body of the C runtime."""

    def __init__(self, data: bytes, real: str = "double") -> None:
        self._lib, error = library(real), ctypes.c_int()
        self._real = np.float32 if real == "float" else np.float64
        self._one = ctypes.c_void_p(self._lib.driver_open(data, ctypes.c_size_t(len(data)), ctypes.byref(error)))
        assert error.value == 0, self._lib.driver_text(error.value)
        self.n = self._lib.driver_n_nodes(self._one)

    def close(self) -> None:
        self._lib.driver_close(self._one)

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a function of the driver; floats are doubles, arrays pointers to copies."""
        return getattr(self._lib, f"driver_{name}")(self._one, *map(self._argument, arguments))

    def _argument(self, value: Any) -> Any:
        if isinstance(value, float):
            return ctypes.c_double(value)
        if isinstance(value, int) or value is None:
            return value
        return np.ascontiguousarray(value, dtype=self._real).ctypes.data_as(ctypes.c_void_p)

    def array(self, name: str, *arguments: Any, shape: tuple[int, ...] = ()) -> Any:
        """A view of the memory of the body."""
        shape = shape or (self.n, 3)
        address = self.call(name, *arguments)
        kind = ctypes.c_float if self._real is np.float32 else ctypes.c_double
        return np.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(kind)), shape)

    @property
    def x(self) -> Any:
        return self.array("positions")

    @property
    def v(self) -> Any:
        return self.array("velocities")

    def at(self, positions: Floats) -> "Body":
        """Move the nodes."""
        self.x[:, : positions.shape[1]] = positions
        self.call("changed")
        return self

    def force(self) -> tuple[float, Floats]:
        """Elastic energy and internal force."""
        found = np.empty((self.n, 3), dtype=self._real)
        energy = self._lib.driver_force(self._one, found.ctypes.data_as(ctypes.c_void_p))
        return energy, found


@contextmanager
def opened(data: bytes, real: str = "double") -> Iterator[Body]:
    body = Body(data, real)
    try:
        yield body
    finally:
        body.close()


# --- a second reader -------------------------------------------------------------------------------------------------

_HEAD = ("n_nodes", "dim", "n_surface", "n_parts", "probe", "ramp", "balanced", "unused")
_SIZES = ("stable_step", "patch", "young", "thickness")
_GROUP = ("kind", "n", "corners", "law", "sheet", "form", "n_simplices", "n_links", "points", "matrices")


def layout(data: bytes) -> dict[str, tuple[str, int, int]]:
    """The arrays of the data by name, as docs/export/c.md describes it: type, offset, and number of entries."""
    found: dict[str, tuple[str, int, int]] = {}
    head = dict(zip(_HEAD, struct.unpack_from("<8I", data, 32), strict=True))
    at = 64

    def take(name: str, kind: str, count: int) -> None:
        nonlocal at
        if count:
            found[name] = (kind, at, count)
        at += -(-count * (4 if kind == "<u4" else 8) // 8) * 8

    for name in _SIZES:
        take(name, "<f8", 1)
    n, dim = head["n_nodes"], head["dim"]
    for name, count in (("rest", 3 * n), ("mass", n), ("load", 3 * n), ("motion", 3 * n)):
        take(name, "<f8", count)
    take("held", "<u4", n)
    take("surface", "<u4", head["n_surface"])
    take("areas", "<f8", head["n_surface"])
    take("equilibrium", "<f8", 3 * n * head["balanced"])
    for number in range(head["n_parts"]):
        one = dict(zip(_GROUP, struct.unpack_from("<10I", data, at), strict=True))
        found[f"{number}.counts"] = ("<u4", at, 10)
        at += 40
        take(f"{number}.scale", "<f8", 1)
        m, links = one["n"], one["n_links"]
        take(f"{number}.nodes", "<u4", m * one["corners"])
        take(f"{number}.simplices", "<u4", one["n_simplices"] * (dim + 1))
        take(f"{number}.links", "<u4", 2 * links)
        for name, count in _values(one, m, links):
            take(f"{number}.{name}", "<f8", count)
    assert at == len(data)
    return found


def _values(one: Mapping[str, int], n: int, links: int) -> list[tuple[str, int]]:
    return {
        1: [("stiffness", n), ("rest_length", n)],
        2: [("stiffness", n)],
        3: [("volume", n), ("constants", n * {0: 2, 1: 1, 2: 6, 3: 3}[one["law"]]), ("weights", n * links)],
        4: [("coupling", one["matrices"] * links**2)],
        5: [("volume", n * one["points"]), ("constants", 2 * n), ("gradients", n * one["points"] * one["corners"] * 3)],
        6: [("volume", n), ("constants", 2 * n), ("weights", n * links)],
    }[one["kind"]]


def arrays(data: bytes) -> dict[str, Any]:
    """The arrays of the data by name."""
    return {name: np.frombuffer(data, kind, count, at) for name, (kind, at, count) in layout(data).items()}


def with_entry(data: bytes, name: str, index: int, value: float) -> bytes:
    """The data with one entry of an array changed, and a right checksum."""
    kind, at, _ = layout(data)[name]
    changed = bytearray(data)
    struct.pack_into("<I" if kind == "<u4" else "<d", changed, at + index * int(kind[-1]), value)
    return summed(bytes(changed))


def summed(data: bytes) -> bytes:
    """The data with its length and checksum set right."""
    return data[:16] + struct.pack("<QQ", len(data), zlib.crc32(data[32:])) + data[32:]
