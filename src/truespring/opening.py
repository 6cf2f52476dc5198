"""The one door to files that are given: only regular files are read, and no more than they hold."""

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
# A file up to this size [bytes] is read without asking what memory there is.
_SMALL = 2**28


def open_file(file: Path, error: type[TruespringError]) -> BufferedReader:
    """Open a regular file, or a link to one, for reading bytes; never wait for another program.

    Raises `error` for what does not exist, is a folder, a named pipe, a device or a socket, or cannot be read.
    """
    try:
        _refuse_other(file, file.stat().st_mode, error)  # before opening: a device may act on that
        number = os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError:
        raise error(f"{file} does not exist: check the path") from None
    except (OSError, ValueError) as found:  # a path may hold what no file system takes
        why = found.strerror if isinstance(found, OSError) else found
        raise error(f"{file} cannot be read ({why}): check the path and its permissions") from None
    stream = os.fdopen(number, "rb")
    try:
        _refuse_other(file, os.fstat(number).st_mode, error)  # it may have been replaced since
    except TruespringError:
        stream.close()
        raise
    return stream


def read_file(file: Path, error: type[TruespringError]) -> bytes:
    """Return the bytes of a regular file, as many as it has when it is opened; see open_file for what is raised."""
    with open_file(file, error) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > _SMALL and size > available_memory() // 2:
            raise error(f"{file} has {size / 2**30:.3g} GiB, more than half of the memory: it is not read")
        try:
            return stream.read(size)
        except OSError as found:
            raise error(f"{file} cannot be read: {found.strerror}") from None


def file_beside(folder: Path, name: str, error: type[TruespringError], who: str = "it ") -> Path:
    """Return the file that one in `folder` names: it lies there or below; `who` begins messages.

    Raises `error` for an absolute path, a path that leads out of the folder, by `..` or by a link, and for what is
    not there.
    """
    told = f"{who}names '{name[:80]}'"
    way_out = "a file names others in its own folder or below: put that file there, and name it so"
    parts = PurePosixPath(name).parts + PureWindowsPath(name).parts
    if not name or "\0" in name or ".." in parts or PurePosixPath(name).is_absolute() or PureWindowsPath(name).anchor:
        raise error(f"{told}: {way_out}")
    one = folder / PureWindowsPath(name).as_posix()
    try:
        is_inside = one.resolve().is_relative_to(folder.resolve())
        is_there = is_inside and one.exists()
    except (OSError, RuntimeError, ValueError):  # too long a name, a circle of links
        is_inside, is_there = True, False
    if not is_inside:
        raise error(f"{told}, a link that leads elsewhere: {way_out}")
    if not is_there:
        raise error(f"{told}, which is not there: keep it beside")
    return one


def _refuse_other(file: Path, mode: int, error: type[TruespringError]) -> None:
    if stat.S_ISDIR(mode):
        raise error(f"{file} is a folder: give the file itself")
    if not stat.S_ISREG(mode):
        raise error(f"{file} is {_KINDS.get(stat.S_IFMT(mode), 'no file')}: only regular files are read")
