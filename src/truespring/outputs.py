"""Output folders: each is whole or plainly unfinished, and never holds two runs of one command."""

import json
import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from truespring.errors import TruespringError

#: The folder, within the one for the results, that they are written to until all are there.
UNFINISHED = "truespring-unfinished"

# Within the folder for the results: which files the last run of each command left, by the name of its summary.
_LISTED = ".truespring.json"


class Output:
    """The results of one run on their way into `folder`.

    They are written to `staging`, the folder UNFINISHED within it. `publish` moves them into their places and removes
    what the former run of the same command left; files of others stay. The `summary` goes first and comes last:
    where it stands, all that it tells of stands beside it. A run that is killed leaves the results of the former one,
    or no summary; a file that cannot be moved leaves those of the former run as they were.

    Raises TruespringError where another run writes into the folder now, OSError where nothing can be written.
    """

    def __init__(self, folder: Path, summary: str) -> None:
        """Make the folder where there is none, and keep other runs out of it until `close`."""
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
        """Let other runs in; what was written and not published stays in `staging`."""
        with suppress(OSError):
            self.staging.rmdir()  # where it is empty
        self._lock.release()

    def publish(self) -> None:
        """Move what was written into its place."""
        new = [file.relative_to(self.staging) for file in sorted(self.staging.rglob("*")) if not file.is_dir()]
        listed = self._listed()
        former = [Path(name) for name in listed.get(self.summary, ())]
        # Whatever happens from here on, the next run knows what to remove.
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
        """The files of the last run of each command; none where the list is damaged or names others."""
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


class Lock:
    """Keeps other runs out of a folder, which is made, until it is released or the process ends, however it ends.

    Raises TruespringError where another run is in it. Where the system has no such locks nobody is kept out.
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
            try:  # the run that was in it may have removed it meanwhile
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
        """Let others in; folders that it made and that are empty go."""
        for folder in self._made:
            with suppress(OSError):
                folder.rmdir()
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _locked(folder: Path) -> int | None:
    """A descriptor that holds the lock of a folder; None where the file system has no locks."""
    import fcntl

    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise TruespringError(
            f"{folder}: another run writes here now: wait until it has ended, or give another --out"
        ) from None
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


class _Moves:
    """Moves of files that are all taken back where one of them fails."""

    def __init__(self) -> None:
        self._done: list[tuple[Path, Path]] = []

    def __enter__(self) -> "_Moves":
        return self

    def move(self, file: Path, to: Path) -> None:
        """Move a file, if it is there, to where none is."""
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
    """Write a file whole: under another name in its folder, down to the disk, then renamed."""
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
    if hasattr(os, "O_DIRECTORY"):  # the name, too, is to outlive the machine
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
    """Remove the folders of former files that have none any more."""
    for parent in sorted({parent for file in former for parent in file.parents if parent.parts}, reverse=True):
        with suppress(OSError):
            (folder / parent).rmdir()
