"""Read input files: regular files only, up to their size at opening."""

import os
import stat
from io import BufferedReader
from pathlib import Path, PurePosixPath, PureWindowsPath

from truespring.errors import TruespringError
from truespring.memory import available_memory

_KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}
# Files up to this size [bytes] are read without a check of the available memory.
_SMALL = 2**28


def open_file(file: Path, error: type[TruespringError]) -> BufferedReader:
    """Open a regular file, or a link to one, for reading bytes, without blocking.

    Raises `error` if the path does not exist, is a folder, a named pipe, a device or a socket, or cannot be read.
    """
    try:
        _require_regular(file, file.stat().st_mode, error)  # before opening: opening a device may have effects
        number = os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError:
        raise error(f"{file} does not exist: check the path") from None
    except (OSError, ValueError) as found:  # the path may have characters that are not allowed
        why = found.strerror if isinstance(found, OSError) else found
        raise error(f"{file} cannot be read ({why}): check the path and its permissions") from None
    stream = os.fdopen(number, "rb")
    try:
        _require_regular(file, os.fstat(number).st_mode, error)  # it may have been replaced since
    except TruespringError:
        stream.close()
        raise
    return stream


def read_file(file: Path, error: type[TruespringError]) -> bytes:
    """Return the bytes of a regular file, up to its size at opening; raises as `open_file`."""
    with open_file(file, error) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > _SMALL and size > available_memory() // 2:
            raise error(f"{file} has {size / 2**30:.3g} GiB, more than half of the available memory")
        try:
            return stream.read(size)
        except OSError as found:
            raise error(f"{file} cannot be read: {found.strerror}") from None


def file_beside(folder: Path, name: str, error: type[TruespringError], who: str = "it ") -> Path:
    """Return the path of a file that another file in `folder` refers to by `name`; messages begin with `who`.

    Raises `error` for an absolute path, a path that leaves the folder by `..` or a link, and a missing file.
    """
    found = f"{who}names '{name[:80]}'"
    way_out = "files may refer only to files in the same folder or below: move that file there, and adapt the name"
    parts = PurePosixPath(name).parts + PureWindowsPath(name).parts
    if not name or "\0" in name or ".." in parts or PurePosixPath(name).is_absolute() or PureWindowsPath(name).anchor:
        raise error(f"{found}: {way_out}")
    one = folder / PureWindowsPath(name).as_posix()
    try:
        is_inside = one.resolve().is_relative_to(folder.resolve())
        is_there = is_inside and one.exists()
    except (OSError, RuntimeError, ValueError):  # a name that is too long, a cycle of links
        is_inside, is_there = True, False
    if not is_inside:
        raise error(f"{found}, a link to another folder: {way_out}")
    if not is_there:
        raise error(f"{found}, which does not exist: put it into that folder")
    return one


def _require_regular(file: Path, mode: int, error: type[TruespringError]) -> None:
    if stat.S_ISDIR(mode):
        raise error(f"{file} is a folder: give a file")
    if not stat.S_ISREG(mode):
        raise error(f"{file} is {_KINDS.get(stat.S_IFMT(mode), 'not a file')}: only regular files can be read")
