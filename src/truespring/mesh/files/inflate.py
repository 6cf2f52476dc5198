"""Compressed data, inflated to the size that they must have: what is cut off, damaged or larger is refused."""

import bz2
import lzma
import zlib
from collections.abc import Callable
from typing import Any

from truespring.memory import available_memory

# So much is given to the library at a time [bytes]: it copies what it leaves.
_CHUNK = 2**16
# What the tables of LZMA may take [bytes]; its own tool asks for 64 MiB at most.
_LZMA_MEMORY = 2**28

_METHODS: dict[str, Callable[[], Any]] = {
    "zlib": zlib.decompressobj,
    "gzip": lambda: zlib.decompressobj(16 + zlib.MAX_WBITS),
    "bzip2": bz2.BZ2Decompressor,
    "lzma": lambda: lzma.LZMADecompressor(memlimit=_LZMA_MEMORY),
}
# Those whose files may be several streams, one behind the other, and zeros at the end.
_MANY = ("gzip", "bzip2")
# A byte deflates to 1/1032 at best: zlib's "Maximally Compressed" note, https://zlib.net/zlib_tech.html
_BEST_RATIO = {"zlib": 1032, "gzip": 1032}


def inflated(data: bytes | memoryview, size: int, method: str) -> bytes:
    """Return data of `size` bytes by a method of "zlib", "gzip", "bzip2" or "lzma".

    Raises ValueError where the data do not end there, by their own end mark, or their checksum does not fit.
    """
    refuse_too_large(size)
    if size > 64 + _BEST_RATIO.get(method, size) * len(data):
        raise ValueError(f"{size} bytes are expected, more than {len(data)} bytes of {method} can hold")
    found, is_ended = _inflated(data, size + 1, method)
    if len(found) > size:
        raise ValueError(f"{method} gives more than the expected {size} bytes")
    if not is_ended:
        raise ValueError(f"cut off: {method} has no end mark, {len(found)} of {size} bytes are there")
    if len(found) < size:
        raise ValueError(f"{size} bytes are expected, {method} gives {len(found)}")
    return found


def beginning(data: bytes, size: int, method: str) -> bytes:
    """Return the first bytes of the inflated data, `size` of them or fewer; raise ValueError where they are damaged."""
    return _inflated(data, size, method)[0]


def _inflated(data: bytes | memoryview, most: int, method: str) -> tuple[bytes, bool]:
    """Return what comes out, `most` bytes at most, and whether the data end with an end mark."""
    parts, left, stream = [], most, _METHODS[method]()
    for begin in range(0, len(data), _CHUNK):
        piece = bytes(data[begin : begin + _CHUNK])
        while piece and left:
            if stream.eof:
                if method in _MANY and not piece.strip(b"\0"):
                    break
                if method not in _MANY:
                    raise ValueError(f"there are more bytes after the end of {method}")
                stream = _METHODS[method]()
            try:
                parts.append(bytes(stream.decompress(piece, left)))
            except (zlib.error, lzma.LZMAError, OSError, EOFError) as error:
                raise ValueError(f"damaged: {method} says '{error}'") from None
            left -= len(parts[-1])
            piece = stream.unused_data
    return b"".join(parts), bool(stream.eof)


def refuse_too_large(size: int) -> None:
    """Raise ValueError where so many bytes are more than half of the memory."""
    if size > 2**28 and size > available_memory() // 2:
        raise ValueError(f"{size / 2**30:.3g} GiB are announced, more than half of the memory")
