"""Decompress data of a known size; truncated, damaged or larger data are an error."""

import bz2
import lzma
import zlib
from collections.abc import Callable
from typing import Any

from truespring.memory import available_memory

# Input per call of the library [bytes]: it copies what it does not use.
_CHUNK = 2**16
# Memory limit of the LZMA decoder [bytes]; the xz tool uses at most 64 MiB.
_LZMA_MEMORY = 2**28

_METHODS: dict[str, Callable[[], Any]] = {
    "zlib": zlib.decompressobj,
    "gzip": lambda: zlib.decompressobj(16 + zlib.MAX_WBITS),
    "bzip2": bz2.BZ2Decompressor,
    "lzma": lambda: lzma.LZMADecompressor(memlimit=_LZMA_MEMORY),
}
# Methods whose files may be several concatenated streams, with zeros at the end.
_MANY = ("gzip", "bzip2")
# A byte deflates to 1/1032 at best: zlib's "Maximally Compressed" note, https://zlib.net/zlib_tech.html
_BEST_RATIO = {"zlib": 1032, "gzip": 1032}


def inflated(data: bytes | memoryview, size: int, method: str) -> bytes:
    """Return data of `size` bytes by a method of "zlib", "gzip", "bzip2" or "lzma".

    Raises ValueError if the data have another size, no end mark or a wrong checksum.
    """
    refuse_too_large(size)
    if size > 64 + _BEST_RATIO.get(method, size) * len(data):
        raise ValueError(f"{size} bytes are expected, more than {len(data)} bytes of {method} can hold")
    found, is_ended = _inflated(data, size + 1, method)
    if len(found) > size:
        raise ValueError(f"{method} gives more than the expected {size} bytes")
    if not is_ended:
        raise ValueError(f"truncated: {method} has no end mark, {len(found)} of {size} bytes are there")
    if len(found) < size:
        raise ValueError(f"{size} bytes are expected, {method} gives {len(found)}")
    return found


def beginning(data: bytes, size: int, method: str) -> bytes:
    """Return the first bytes of the decompressed data, at most `size`; raise ValueError if they are damaged."""
    return _inflated(data, size, method)[0]


def _inflated(data: bytes | memoryview, most: int, method: str) -> tuple[bytes, bool]:
    """Return at most `most` decompressed bytes, and whether the data end with an end mark."""
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
                raise ValueError(f"damaged: {method} reports '{error}'") from None
            left -= len(parts[-1])
            piece = stream.unused_data
    return b"".join(parts), bool(stream.eof)


def refuse_too_large(size: int) -> None:
    """Raise ValueError if `size` bytes are more than half of the memory."""
    if size > 2**28 and size > available_memory() // 2:
        raise ValueError(f"{size / 2**30:.3g} GiB are stated, more than half of the memory")
