"""The contract of every format of meshes, results and label images: FORMATS, READERS and IMAGES."""

import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.file_samples import image_sample, mesh_sample, result_sample
from truespring.cli import main
from truespring.errors import MeshError, ReferenceFileError, TruespringError
from truespring.mesh.files import FORMATS, read_mesh
from truespring.mesh.files.heads import HEAD
from truespring.mesh.files.images import IMAGES, read_labels
from truespring.reference import READERS, format_of, read_record

OPTIONS = {name for form in READERS.values() for name in form.options}


def contents_of_mesh(file: Path) -> tuple[bytes, ...]:
    mesh = read_mesh(file)
    groups = {**mesh.node_groups, **mesh.element_groups, **mesh.facet_groups}
    return mesh.nodes.tobytes(), mesh.elements.tobytes(), *(groups[name].tobytes() for name in sorted(groups))


def contents_of_result(file: Path) -> tuple[bytes, ...]:
    given = {"undeformed": file.with_name("rest.stl")} if file.suffix == ".stl" else {}
    record = read_record(file, **given)
    return record.points.tobytes(), *(level.displacement.tobytes() for level in record.levels)


def contents_of_image(file: Path) -> tuple[bytes, ...]:
    found = read_labels(file)
    return tuple(part.tobytes() for part in found[:4])


#: Of each table: a sample of a key, what it holds, the error of its readers.
TABLES: dict[str, tuple[Any, Callable[[Path, str], Path], Callable[[Path], tuple[bytes, ...]], type[Exception]]] = {
    "mesh": (FORMATS, mesh_sample, contents_of_mesh, MeshError),
    "result": (READERS, result_sample, contents_of_result, ReferenceFileError),
    "image": (IMAGES, image_sample, contents_of_image, MeshError),
}
SLOW = {".rst": [pytest.mark.verification]}  # each is read in a process of its own; tests/test_rst.py cuts some
every_format = pytest.mark.parametrize(
    ("what", "key"), [pytest.param(what, key, marks=SLOW.get(key, ())) for what in TABLES for key in TABLES[what][0]]
)
by_content = pytest.mark.parametrize(
    ("what", "key"), [(what, key) for what in ("mesh", "result") for key in TABLES[what][0]]
)


def places_to_cut(data: bytes) -> Iterator[int]:
    """Anywhere, within the last record and its end, and between lines of a text."""
    yield from np.linspace(0, len(data) - 1, 24).astype(int).tolist()
    yield from range(max(len(data) - (12 if len(data) < 1 << 19 else 1), 0), len(data))
    if b"\0" not in data:
        ends = [match.end() for match in re.finditer(rb"\n", data)]
        yield from ends[:: -(-len(ends) // 60) or 1]
        yield from ends[-8:-1]


@every_format
def test_a_file_that_is_cut_off_anywhere_is_an_error(what: str, key: str, tmp_path: Path) -> None:
    """But where its entry says why that cannot be noticed: then it must be so somewhere."""
    table, sample, contents, error = TABLES[what]
    file = sample(tmp_path, key)
    whole, data = contents(file), file.read_bytes()
    refused, passed = 0, []
    for end in sorted({*places_to_cut(data)}):
        file.write_bytes(data[:end])
        try:
            found = contents(file)
        except TruespringError as raised:
            assert isinstance(raised, error) and str(file) in str(raised)
            refused += 1
        else:
            passed += [end] if found != whole else []
    assert refused > 15
    assert bool(passed) == bool(table[key].unnoticed), passed


@by_content
def test_a_format_is_recognised_by_its_content_and_no_other_is(what: str, key: str, tmp_path: Path) -> None:
    table, sample, contents, _ = TABLES[what]
    file = sample(tmp_path, key)
    data = file.read_bytes()
    marked = getattr(table[key], "is_marked", True)
    for head in (data, data[:HEAD], b"\xef\xbb\xbf" + data):
        fitting = [other for other, form in table.items() if form.recognises(head.removeprefix(b"\xef\xbb\xbf"))]
        assert fitting == [key] or (not marked and fitting == [])
    for suffix in (*table, ".out", key.upper()) if marked else ():
        other = Path(shutil.copyfile(file, tmp_path / f"other{suffix}"))
        assert contents(other) == contents(file) if what == "mesh" else format_of(other) == key


@pytest.mark.parametrize("key", READERS)
def test_an_option_of_other_formats_is_an_error_that_names_them(key: str, tmp_path: Path) -> None:
    file = result_sample(tmp_path, key)
    for name in OPTIONS - READERS[key].options:
        for_others = ", ".join(other for other, form in READERS.items() if name in form.options)
        with pytest.raises(ReferenceFileError, match=rf"{name} .*{re.escape(key)} files, .*{re.escape(for_others)}"):
            read_record(file, **{name: file if name != "field" else "U"})  # type: ignore[arg-type]


def test_help_names_every_format_of_results(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "--help"]) == 0
    assert set(READERS) <= set(re.findall(r"(?<![\w/])\.\w+", capsys.readouterr().out))
