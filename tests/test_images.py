"""Label images: what their headers tell, held against SimpleITK; names of segments; what is truncated or damaged."""

import gzip
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from truespring.errors import MeshError, TruespringError
from truespring.mesh.files.images import read_labels
from truespring.mesh.files.labels import Labels
from truespring.mesh.files.nifti import _FIELDS, _MAGIC

TURN = np.array([[np.cos(0.5), -np.sin(0.5), 0.0], [0.0, 0.0, -1.0], [np.sin(0.5), np.cos(0.5), 0.0]])
SPACING, ORIGIN = (2.0, 3.0, 4.5), (10.0, -20.0, 30.0)
VALUES = np.random.default_rng(2).integers(0, 100, (6, 5, 4))


def image(dtype: str = "u1", direction: Any = TURN) -> Any:
    import SimpleITK

    found = SimpleITK.GetImageFromArray(VALUES.astype(dtype).transpose())
    found.SetSpacing(SPACING)
    found.SetOrigin(ORIGIN)
    found.SetDirection(np.asarray(direction).ravel().tolist())
    return found


def written(file: Path, image: Any, compressed: bool = False) -> Path:
    import SimpleITK

    SimpleITK.WriteImage(image, str(file), useCompression=compressed)
    return file


def agree_with_simpleitk(file: Path) -> Labels:
    """Read a file twice, and hold every voxel and its place against SimpleITK's."""
    import SimpleITK

    wanted, found = SimpleITK.ReadImage(str(file)), read_labels(file)
    np.testing.assert_array_equal(found.values, SimpleITK.GetArrayFromImage(wanted).transpose())
    assert found.spacing == pytest.approx(np.array(wanted.GetSpacing()), rel=1e-6)
    assert found.origin == pytest.approx(np.array(wanted.GetOrigin()), abs=1e-4)
    assert found.direction == pytest.approx(np.array(wanted.GetDirection()).reshape(3, 3), abs=1e-6)
    return found


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("suffix", [".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd"])
def test_images_are_read_as_simpleitk_reads_them(suffix: str, compressed: bool, tmp_path: Path) -> None:
    for dtype in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"):
        agree_with_simpleitk(written(tmp_path / f"image{suffix}", image(dtype), compressed))
    agree_with_simpleitk(written(tmp_path / f"image{suffix}", image("i2", TURN @ np.diag([1, 1, -1])), compressed))


def patched(file: Path, *patches: tuple[int, str, float]) -> Path:
    data = bytearray(file.read_bytes())
    for offset, form, value in patches:
        struct.pack_into(form, data, offset, value)
    file.write_bytes(data)
    return file


@pytest.mark.parametrize(
    ("patches", "note"),
    [
        ([(254, "<h", 0)], "LPS"),  # qform alone
        ([(252, "<h", 0)], "LPS"),  # sform alone
        ([(252, "<h", 0), (254, "<h", 0)], "no position of the voxels"),
        ([(123, "B", 1)], "LPS"),  # metres
        ([(123, "B", 3)], "LPS"),  # micrometres
        ([(112, "<f", 2.0), (116, "<f", 1.0)], "LPS"),  # a scale of the values
        ([(268, "<f", 77.0)], "two transforms"),
    ],
)
def test_nifti_has_places_in_several_ways(patches: list[tuple[int, str, float]], note: str, tmp_path: Path) -> None:
    found = agree_with_simpleitk(patched(written(tmp_path / "image.nii", image("i2")), *patches))
    assert any(note in one for one in found.notes)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("size", [348, 540])
def test_both_versions_of_nifti_in_either_order_of_bytes(size: int, order: Any, tmp_path: Path) -> None:
    names, formats, offsets = zip(*((name, *where) for name, where in _FIELDS[size].items()), strict=True)
    layout = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size}).newbyteorder(order)
    header = np.zeros((), layout)
    told = {"dim": [3, 6, 5, 4, 1, 1, 1, 1], "datatype": 4, "bitpix": 16, "pixdim": [1, 2, 3, 4, 1, 1, 1, 1]}
    told |= {"offset": size + 4, "sform": 1, "units": 2, "magic": _MAGIC[size], "slope": 1}
    told |= {"rows": [[0, -3, 0, 7], [2, 0, 0, 8], [0, 0, 4, 9]]}  # a quarter turn about z
    for name, value in told.items():
        header[name] = value
    data = struct.pack(f"{order}i", size) + header.tobytes()[4:] + bytes(4)
    (tmp_path / "image.nii").write_bytes(data + VALUES.astype(f"{order}i2").tobytes(order="F"))
    found = read_labels(tmp_path / "image.nii")
    np.testing.assert_array_equal(found.values, VALUES)
    assert found.spacing.tolist() == [2, 3, 4] and found.origin.tolist() == [-7, -8, 9]
    assert found.direction == pytest.approx(np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), abs=1e-15)


@pytest.mark.parametrize("space", ["right-anterior-superior", "left-anterior-superior", "LPS", "scanner-xyz"])
def test_spaces_of_nrrd(space: str, tmp_path: Path) -> None:
    file = written(tmp_path / "image.nrrd", image())
    file.write_bytes(file.read_bytes().replace(b"left-posterior-superior", space.encode()))
    agree_with_simpleitk(file)


@pytest.mark.parametrize("encoding", ["raw", "hex", "text", "gzip", "bzip2"])
def test_encodings_of_nrrd(encoding: str, tmp_path: Path) -> None:
    import bz2

    raw = VALUES.astype("<i2").tobytes(order="F")
    coded = {
        "raw": raw,
        "hex": raw.hex().encode() + b"\n",
        "text": b"\n".join(str(value).encode() for value in VALUES.ravel(order="F")) + b"\n",
        "gzip": gzip.compress(raw),
        "bzip2": bz2.compress(raw),
    }[encoding]
    head = f"NRRD0004\ntype: short\ndimension: 3\nsizes: 6 5 4\nendian: little\nencoding: {encoding}\nspacings: 2 3 4\n"
    (tmp_path / "image.nrrd").write_bytes(head.encode() + b"axis mins: 1 2 3\n\n" + coded)
    found = read_labels(tmp_path / "image.nrrd")
    np.testing.assert_array_equal(found.values, VALUES)
    assert found.spacing.tolist() == [2, 3, 4] and found.origin.tolist() == [2, 3.5, 5]  # the middle of the first voxel


def test_gzip_in_several_parts_and_zeros_behind(tmp_path: Path) -> None:
    data = written(tmp_path / "image.nii", image()).read_bytes()
    packed = b"".join(gzip.compress(data[at : at + 100]) for at in range(0, len(data), 100))
    (tmp_path / "image.nii.gz").write_bytes(packed + bytes(512))
    np.testing.assert_array_equal(read_labels(tmp_path / "image.nii.gz").values, VALUES)


# --- axes that are not quite upright, segments with names ---------------------------------------------------------


def sheared(folder: Path, shear: float) -> Path:
    """An image of 6 x 5 x 4 voxels whose axes x and y have the cosine `shear`, as a header of float32 tells it."""
    file = written(folder / "image.nii", image("u1", np.eye(3)))
    places = [(row, axis, 280 + 16 * row + 4 * axis) for row in range(3) for axis in range(3)]
    patches = [(at, "<f", SPACING[row] if axis == row else 0.0) for row, axis, at in places]
    return patched(file, *patches, (280 + 4, "<f", shear * SPACING[1]), (252, "<h", 0))


def test_axes_that_are_nearly_upright_are_taken_and_told(tmp_path: Path) -> None:
    for shear, is_told in ((0.0, False), (3e-4, True), (9e-3, True)):
        file = sheared(tmp_path, shear)
        mesh = ts.read_voxels(file, int(VALUES[2, 2, 2]))
        assert mesh.measures == pytest.approx(np.full(len(mesh.elements), 27e-9), rel=1e-6)
        assert any("not quite perpendicular" in note for note in mesh.notes) == is_told
    with pytest.raises(MeshError, match=r"image\.nii: the axes .* is 0\.02, at most 0\.01 .*resample"):
        read_labels(sheared(tmp_path, 0.02))


def test_more_lines_to_skip_than_there_are_are_refused_at_once(tmp_path: Path) -> None:
    head = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 200 200 200\nencoding: raw\nline skip: {}\n\n"
    file = tmp_path / "image.nrrd"
    file.write_bytes(head.format(2).encode() + b"one\ntwo\n" + bytes(200**3))
    assert read_labels(file).values.shape == (200, 200, 200)
    file.write_bytes(head.format(100_000_000).encode() + b"one\ntwo\n" + bytes(200**3))
    with pytest.raises(MeshError, match="'line skip' is 100000000, there are 2 lines"):
        read_labels(file)


SEGMENTS = (
    "Segment0_ID:=Segment_1\nSegment0_Name:=liver\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n"
    "Segment1_ID:=Segment_2\nSegment1_Name:=Tumour\nSegment1_LabelValue:=2\nSegment1_Layer:=0\n"
    "Segment2_ID:=Segment_3\nSegment2_Name:=vessel\nSegment2_LabelValue:=1\nSegment2_Layer:=1\n"
)


def segmentation(folder: Path) -> Path:
    """A segmentation as 3D Slicer writes it: two layers, for the vessel overlaps the liver."""
    values = np.zeros((2, 6, 5, 4), dtype="u1")
    values[0, :3] = 1
    values[0, 3:5] = 2
    values[1, :, 2, 2] = 1
    head = (
        "NRRD0004\ntype: unsigned char\ndimension: 4\nspace: left-posterior-superior\nsizes: 2 6 5 4\n"
        "space directions: none (2,0,0) (0,3,0) (0,0,4)\nkinds: list domain domain domain\nencoding: gzip\n"
        f"space origin: (10,20,30)\n{SEGMENTS}Segmentation_MasterRepresentation:=Binary labelmap\n\n"
    )
    (folder / "organ.seg.nrrd").write_bytes(head.encode() + gzip.compress(values.tobytes(order="F")))
    return folder / "organ.seg.nrrd"


def test_segments_are_named(tmp_path: Path) -> None:
    file = segmentation(tmp_path)
    for label, count in (("liver", 60), ("tumour", 40), ("vessel", 6), (2, 40)):
        mesh = ts.read_voxels(file, label)
        assert len(mesh.elements) == count and mesh.measures.sum() == pytest.approx(count * 24e-9)
    assert ts.read_voxels(file, "vessel").lower == pytest.approx([9e-3, 24.5e-3, 36e-3])
    with pytest.raises(MeshError, match=r"label 1 is in 2 of 2 layers: name the segment, .*liver"):
        ts.read_voxels(file, 1)
    there = r"there are 1 \('liver'\), 2 \('Tumour'\), 1 \('vessel'\)"
    with pytest.raises(MeshError, match=rf"no segment 'livr' \(did you mean 'liver'\?\); {there}"):
        ts.read_voxels(file, "livr")
    with pytest.raises(MeshError, match=rf"no voxel has the label 7; {there}"):
        ts.read_voxels(file, 7)
    with pytest.raises(MeshError, match="no segment 'liver', the image has no names; there are 3, "):
        ts.read_voxels(written(tmp_path / "image.mha", image()), "liver")


def test_a_study_names_a_segment(tmp_path: Path) -> None:
    from truespring.study import read_study

    segmentation(tmp_path)
    (tmp_path / "organ.toml").write_text(
        '[mesh]\nvoxels = "organ.seg.nrrd"\nlabel = "liver"\nedge = "3 mm"\n'
        '[material]\nyoung = "10 kPa"\npoisson = 0.3\n'
        '[[support]]\non = "left"\n[[load]]\non = "right"\nforce = [0, 0, -1e-3]\n'
        '[models.springs]\nkind = "springs"\nrule = "isotropic"\n'
    )
    assert (
        len(read_study(tmp_path / "organ.toml").problem.mesh.elements) == 2 * 5 * 5
    )  # a sixth layer is filled by a third


# --- what is truncated, damaged or larger than it says --------------------------------------------------------------


def what_counts(file: Path) -> tuple[Any, ...]:
    found = read_labels(file)
    return found.values.shape, *(part.tobytes() for part in found[:4])


FORMATS = [(".nii", False), (".nii.gz", True), (".nrrd", False), (".nrrd", True), (".mha", False), (".mha", True)]
FORMATS += [(".npy", False), (".vti", True)]


def ball(folder: Path, suffix: str, compressed: bool) -> Path:
    x = np.arange(12) - 5.5
    values = (x[:, None, None] ** 2 + x[:, None] ** 2 + x**2 < 30).astype("u1")
    file = folder / f"ball{suffix}"
    if suffix == ".npy":
        np.save(file, values)
    elif suffix == ".vti":
        import pyvista

        grid = pyvista.ImageData(dimensions=values.shape)
        grid.point_data["labels"] = values.ravel(order="F")
        grid.save(file)
    else:
        import SimpleITK

        written(file, SimpleITK.GetImageFromArray(values), compressed)
    return file


def beginning_of_voxels(data: bytes, suffix: str) -> int:
    """Where the voxels begin behind a header that is not compressed."""
    marks = {".mha": b"ElementDataFile = LOCAL\n", ".nrrd": b"\n\n", ".vti": b'format="binary"', ".nii.gz": b""}
    return data.index(marks[suffix]) + len(marks[suffix])


def damaged(data: bytes, suffix: str, compressed: bool, count: int) -> Iterator[tuple[str, bytes]]:
    """Files that are truncated anywhere and, of compressed voxels, with a flipped bit."""
    rng = np.random.default_rng(len(data))
    for end in sorted({0, len(data) - 1, *rng.integers(0, len(data), count).tolist()}):
        if suffix == ".vti" and end >= len(data) - 1:
            continue  # the last line end
        yield "cut", data[:end]
    first = 8 * beginning_of_voxels(data, suffix) if compressed else 0
    for bit in rng.integers(first, 8 * len(data), count if compressed else 0).tolist():
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        yield "flipped", bytes(flipped)


def hold(folder: Path, suffix: str, compressed: bool, count: int) -> None:
    file = ball(folder, suffix, compressed)
    data, wanted, refused = file.read_bytes(), what_counts(file), 0
    for how, wrong in damaged(data, suffix, compressed, count):
        file.write_bytes(wrong)
        try:
            found = what_counts(file)
        except TruespringError:
            refused += 1
        else:
            assert how == "flipped" and found == wanted
    assert refused > count // 2


@pytest.mark.parametrize(("suffix", "compressed"), FORMATS)
def test_half_an_image_is_refused_and_a_flipped_bit_too(suffix: str, compressed: bool, tmp_path: Path) -> None:
    hold(tmp_path, suffix, compressed, 60)


@pytest.mark.verification
@pytest.mark.parametrize(("suffix", "compressed"), FORMATS)
def test_images_cut_and_flipped_at_many_places(suffix: str, compressed: bool, tmp_path: Path) -> None:
    hold(tmp_path, suffix, compressed, 3000)


@pytest.mark.parametrize("suffix", [".nii", ".nii.gz", ".nrrd", ".mha", ".npy", ".vti"])
def test_no_bit_of_a_header_ends_in_a_traceback(suffix: str, tmp_path: Path) -> None:
    file = ball(tmp_path, suffix, suffix == ".nii.gz")
    data = file.read_bytes()
    for bit in np.random.default_rng(3).integers(0, 8 * min(len(data), 360), 80).tolist():
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        file.write_bytes(flipped)
        try:
            read_labels(file)
        except TruespringError as error:
            assert str(file) in str(error)


def test_what_inflates_to_more_than_its_header_tells_is_refused(tmp_path: Path) -> None:
    """16 MiB of zeros behind a header of 6 x 5 x 4 voxels."""
    zeros = bytes(2**24)
    nii = written(tmp_path / "image.nii", image()).read_bytes()[:352]
    (tmp_path / "bomb.nii.gz").write_bytes(gzip.compress(nii + zeros))
    for name, packed in (("nrrd", gzip.compress(zeros)), ("mha", zlib.compress(zeros))):
        data = written(tmp_path / f"image.{name}", image(), compressed=True).read_bytes()
        head = data[: beginning_of_voxels(data, f".{name}")]
        if name == "mha":
            head = b"".join(line for line in head.splitlines(True) if b"CompressedDataSize" not in line)
        (tmp_path / f"bomb.{name}").write_bytes(head + packed)
    for name in ("nii.gz", "nrrd", "mha"):
        with pytest.raises(MeshError, match=rf"bomb\.{name}: .*more than the expected \d+ bytes"):
            read_labels(tmp_path / f"bomb.{name}")


def test_a_header_that_tells_terabytes_is_refused_by_the_size_of_its_file(tmp_path: Path) -> None:
    np.save(tmp_path / "image.npy", VALUES)
    data = (tmp_path / "image.npy").read_bytes()
    (tmp_path / "image.npy").write_bytes(data.replace(b"(6, 5, 4), ", b"(60000, 50000, 40000),")[:700])
    with pytest.raises(MeshError, match=r"image\.npy: its header states 960000000000000 bytes|damaged"):
        read_labels(tmp_path / "image.npy")
    patched(written(tmp_path / "image.nii", image()), *((42 + 2 * axis, "<h", 32000) for axis in range(3)))
    with pytest.raises(MeshError, match=r"image\.nii: .* GiB are stated, more than half of the memory"):
        read_labels(tmp_path / "image.nii")


@pytest.mark.parametrize(
    "wrong", [b"{'descr': '|u1', 'fortran_order': (((", b"lambda: 0", b"{'descr': 3}", b"\xff\xfe"]
)
def test_the_header_of_an_array_may_hold_anything(wrong: bytes, tmp_path: Path) -> None:
    np.save(tmp_path / "image.npy", VALUES)
    data = (tmp_path / "image.npy").read_bytes()
    (tmp_path / "image.npy").write_bytes(data[:10] + wrong.ljust(118) + data[128:])
    with pytest.raises(MeshError, match=r"image\.npy: this is no \.npy file, or its header is damaged"):
        read_labels(tmp_path / "image.npy")


@pytest.mark.parametrize("name", ["../secret.bin", "/etc/hostname", "link.bin", "sub/../../secret.bin"])
@pytest.mark.parametrize("form", ["mhd", "mhd list", "nhdr", "nhdr list"])
def test_a_header_names_files_beside_it_only_and_prints_none_of_their_bytes(
    name: str, form: str, tmp_path: Path
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "sub").mkdir()
    (tmp_path / "secret.bin").write_bytes(b"SECRETS!")
    (folder / "link.bin").symlink_to(tmp_path / "secret.bin")
    (folder / "own.bin").write_bytes(b"\1" * 8)
    heads = {
        "mhd": "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = ",
        "nhdr": "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: ",
    }
    kind, _, many = form.partition(" ")
    file = folder / f"image.{kind}"
    before = heads[kind] + ("LIST\n" if many else "")
    file.write_text(before + "own.bin\n" + ("" if many or kind == "mhd" else "\n"))
    assert len(ts.read_voxels(file, 1).elements) == 8
    file.write_text(before + name + "\n" + ("" if many or kind == "mhd" else "\n"))
    with pytest.raises(MeshError, match=r"image\.\w+: it names '.*same folder or below") as error:
        ts.read_voxels(file, 1)
    assert not {"83", "69", "SECRET"} & set(str(error.value).replace(",", " ").split())


def test_labels_may_be_floating_point_numbers_of_any_precision(tmp_path: Path) -> None:
    values = np.zeros((4, 3, 3))
    values[1:3, 1, 1] = 1
    for precision in (np.float16, np.float32, np.float64):
        np.save(tmp_path / "labels.npy", values.astype(precision))
        assert len(ts.read_voxels(tmp_path / "labels.npy", label=1).elements) == 2
