"""Only regular files are read: by every reader, at once, and no more than they hold."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from truespring.errors import TruespringError
from truespring.mesh.files import FORMATS, read_mesh
from truespring.mesh.files.images import IMAGES, read_labels
from truespring.opening import file_beside, open_file, read_file
from truespring.reference.result import READERS, read_record
from truespring.study import read_study
from truespring.sweeping.values import read_points

EVERY: dict[str, Callable[[Path], object]] = {
    **{f"mesh{suffix}": read_mesh for suffix in FORMATS},
    **{f"result{suffix}": read_record for suffix in READERS},
    **{f"image{suffix}": read_labels for suffix in IMAGES},
    "study.toml": read_study,
    "points.csv": read_points,
}


def pipe(file: Path) -> None:
    os.mkfifo(file)


def device(file: Path) -> None:
    file.symlink_to("/dev/zero")


def listener(file: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(file))


NOT_REGULAR = {"a named pipe": pipe, "a device": device, "a socket": listener, "a folder": Path.mkdir}


@pytest.mark.parametrize("what", NOT_REGULAR)
def test_no_reader_opens_what_is_no_regular_file(what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # the path of a socket is short
    for name, read in EVERY.items():
        NOT_REGULAR[what](Path(name))
        with pytest.raises(TruespringError, match=rf"{name}.* is {what}"):
            read(Path(name))
    assert len(EVERY) > 25


def test_a_link_to_a_regular_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"abc")
    (tmp_path / "link").symlink_to(tmp_path / "file")
    assert read_file(tmp_path / "link", TruespringError) == b"abc"


def test_no_more_is_read_than_a_file_holds_when_it_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"abc")
    told = os.fstat

    def growing(number: int) -> os.stat_result:
        found = told(number)
        with file.open("ab") as stream:
            stream.write(b"def")
        return found

    monkeypatch.setattr(os, "fstat", growing)
    assert len(read_file(file, TruespringError)) <= 6


def test_what_is_replaced_by_a_pipe_after_it_was_looked_at_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, opening = tmp_path / "file", os.open
    file.write_bytes(b"abc")

    def swapped(name: Path, flags: int) -> int:
        file.unlink()
        os.mkfifo(file)
        return opening(name, flags)

    monkeypatch.setattr(os, "open", swapped)
    with pytest.raises(TruespringError, match="is a named pipe"):
        open_file(file, TruespringError)


@pytest.mark.parametrize("name", ["a\0b", "a" * 5000, "loop", "none"])
def test_names_that_no_file_has(name: str, tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(TruespringError, match=r"cannot be read|does not exist"):
        read_file(tmp_path / name, TruespringError)
    with pytest.raises(TruespringError, match="names '"):
        file_beside(tmp_path, name, TruespringError)
