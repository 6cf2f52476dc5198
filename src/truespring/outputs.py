"""Output folders: each is complete or clearly unfinished, and holds one run of a command."""

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType

from truespring.errors import OutputError

#: Subfolder of the output folder for the results of a run that has not ended.
UNFINISHED = "truespring-unfinished"

# File in the output folder that lists the files of the last run of each command, by the name of its summary.
_LISTED = ".truespring.json"


class Output:
    """Write the results of one run to `folder`, all or none.

    Write the files to `staging`, the subfolder UNFINISHED; `publish` moves them to `folder` and removes the files of
    the previous run of the same command. Other files are kept. The `summary` is removed first and moved last: a folder
    with a summary has all files of that run. If a run is killed, the results of the previous run remain, or the
    summary is missing; if a file cannot be moved, the results of the previous run remain unchanged.

    Raises OutputError if another run is writing to the folder, OSError if the folder cannot be written.
    """

    def __init__(self, folder: Path, summary: str) -> None:
        """Create the folder if it does not exist, and lock it until `close`."""
        self.folder, self.summary = folder, summary
        self.staging = folder / UNFINISHED
        self._lock = Lock(self.staging)
        try:
            _empty(self.staging)
        except BaseException:
            self._lock.release()
            raise

    def __enter__(self) -> "Output":
        """Return the output."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the output."""
        self.close()

    def close(self) -> None:
        """Unlock the folder; files that were not published stay in `staging`."""
        with suppress(OSError):
            self.staging.rmdir()  # fails if not empty
        self._lock.release()

    def publish(self) -> None:
        """Move the files from `staging` to the output folder."""
        new = [file.relative_to(self.staging) for file in sorted(self.staging.rglob("*")) if not file.is_dir()]
        listed = self._listed()
        former = [Path(name) for name in listed.get(self.summary, ())]
        # If this run is killed from here on, the next run can still remove its files.
        self._list({**listed, self.summary: sorted({one.as_posix() for one in (*former, *new)})})
        with _Moves() as moves:
            for file in sorted({*former, *new}, key=lambda file: file.name != self.summary):
                moves.move(self.folder / file, self.staging / ".former" / file)
            for file in sorted(new, key=lambda file: file.name == self.summary):
                moves.move(self.staging / file, self.folder / file)
        mine = {one.as_posix() for one in new}
        others = {name: [file for file in files if file not in mine] for name, files in listed.items()}
        self._list({**others, self.summary: sorted(mine)})
        shutil.rmtree(self.staging / ".former", ignore_errors=True)
        _remove_empty(self.folder, former)
        _empty(self.staging)

    def _listed(self) -> dict[str, list[str]]:
        """Return the files of the last run of each command; empty if the list is damaged or has paths outside."""
        try:
            listed = json.loads((self.folder / _LISTED).read_text(encoding="utf-8"))
            return {
                str(name): [file for file in map(str, files) if _is_within(Path(file))]
                for name, files in listed.items()
            }
        except (OSError, ValueError, AttributeError, TypeError):
            return {}

    def _list(self, listed: Mapping[str, list[str]]) -> None:
        write_whole(self.folder / _LISTED, json.dumps(listed, indent=1).encode())


@contextmanager
def writing(out: Path) -> Iterator[None]:
    """Convert an OSError to an OutputError that names the file and the folder of the results."""
    try:
        yield
    except OSError as error:
        place = error.filename or out
        raise OutputError(f"out = {out}: {place} cannot be written: {error.strerror}") from None


@contextmanager
def writing_file(file: Path) -> Iterator[None]:
    """Convert an OSError to an OutputError that names the file."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{error.filename or file} cannot be written: {error.strerror or error}") from None


class Lock:
    """Create and lock a folder until `release` or the end of the process.

    Raises OutputError if another run has locked it. Does nothing on systems without such locks.
    """

    def __init__(self, folder: Path) -> None:
        """Take the lock."""
        self._made = [one for one in (folder, *folder.parents) if not one.exists()]
        self._descriptor: int | None = None
        folder.mkdir(parents=True, exist_ok=True)
        while self._descriptor is None and hasattr(os, "O_DIRECTORY"):
            descriptor = _locked(folder)
            if descriptor is None:
                return
            try:  # the previous run may have removed the folder meanwhile
                if os.path.samestat(os.fstat(descriptor), folder.stat()):
                    self._descriptor = descriptor
                    return
            except FileNotFoundError:
                folder.mkdir(parents=True, exist_ok=True)
            os.close(descriptor)

    def __enter__(self) -> "Lock":
        """Return the lock."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release the lock."""
        self.release()

    def release(self) -> None:
        """Release the lock, and remove the folders that it created if they are empty."""
        for folder in self._made:
            with suppress(OSError):
                folder.rmdir()
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _locked(folder: Path) -> int | None:
    """Return a descriptor that holds the lock of a folder; None if the file system has no locks."""
    import fcntl

    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise OutputError(
            f"{folder}: another run is writing to this folder: wait until it ends, or choose another folder (out)"
        ) from None
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


class _Moves:
    """Move files, and move all of them back if one fails."""

    def __init__(self) -> None:
        self._done: list[tuple[Path, Path]] = []

    def __enter__(self) -> "_Moves":
        return self

    def move(self, file: Path, to: Path) -> None:
        """Move a file, if it exists, to a path that does not exist."""
        if not file.is_symlink() and not file.exists():
            return
        to.parent.mkdir(parents=True, exist_ok=True)
        file.replace(to)
        self._done.append((file, to))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            return
        for file, to in reversed(self._done):
            with suppress(OSError):
                file.parent.mkdir(parents=True, exist_ok=True)
                to.replace(file)


def write_whole(file: Path, content: bytes) -> None:
    """Write a file atomically: write a temporary file in the same folder, flush it to disk, rename it."""
    beside = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        with beside.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        beside.replace(file)
    except BaseException:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        raise
    if hasattr(os, "O_DIRECTORY"):  # flush the new name to disk as well
        folder = os.open(file.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _is_within(file: Path) -> bool:
    return not file.is_absolute() and ".." not in file.parts and file.parts[:1] not in ((), (UNFINISHED,))


def _empty(folder: Path) -> None:
    for one in folder.iterdir():
        if one.is_dir() and not one.is_symlink():
            shutil.rmtree(one)
        else:
            one.unlink()


def _remove_empty(folder: Path, former: list[Path]) -> None:
    """Remove the folders of former files that are empty now."""
    for parent in sorted({parent for file in former for parent in file.parents if parent.parts}, reverse=True):
        with suppress(OSError):
            (folder / parent).rmdir()
