"""Bodies from label images: the same body from every format, in its place, and what is refused."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from truespring.errors import TruespringError
from truespring.mesh.files.images import read_labels

SPACING, ORIGIN = (2.0, 3.0, 4.0), (10.0, -20.0, 30.0)
# A turn about z by 30 degrees, then about x by 90.
C, S = np.cos(np.pi / 6), 0.5
DIRECTION = np.array([[C, -S, 0.0], [0.0, 0.0, -1.0], [S, C, 0.0]])


def labelled() -> np.ndarray[Any, Any]:
    """Two organs: an L of label 4, and apart from it a voxel of the same label; beside them a block of label 7."""
    labels = np.zeros((6, 5, 4), dtype=np.uint8)
    labels[1:4, 1, 1:3] = 4
    labels[1, 1:4, 1:3] = 4
    labels[5, 4, 3] = 4
    labels[4:6, 0:2, 0:2] = 7
    return labels


def written(folder: Path, suffix: str) -> Path:
    """The image by SimpleITK or PyVista, turned and shifted."""
    file = folder / f"organ{suffix}"
    if suffix == ".vti":
        import pyvista as pv

        grid = pv.ImageData(dimensions=labelled().shape, spacing=SPACING, origin=ORIGIN, direction_matrix=DIRECTION)
        grid.point_data["labels"] = labelled().ravel(order="F")
        grid.save(file)
        return file
    import SimpleITK

    image = SimpleITK.GetImageFromArray(labelled().transpose())
    image.SetSpacing(SPACING)
    image.SetOrigin(ORIGIN)
    image.SetDirection(DIRECTION.ravel().tolist())
    SimpleITK.WriteImage(image, str(file))
    return file


@pytest.mark.parametrize("suffix", [".nii", ".nii.gz", ".nrrd", ".mha", ".vti"])
def test_every_format_gives_the_body_in_its_place(suffix: str, tmp_path: Path) -> None:
    mesh = ts.read_voxels(written(tmp_path, suffix), 4)
    assert len(mesh.elements) == 10
    assert mesh.measures.sum() == pytest.approx(10 * 24e-9, rel=1e-6)
    wanted = [
        np.array(ORIGIN) + DIRECTION @ (np.array(index) * SPACING)
        for index in np.argwhere(labelled() == 4)
        if tuple(index) != (5, 4, 3)
    ]
    order = lambda places: np.array(sorted(np.round(places, 6).tolist()))  # noqa: E731
    assert order(1e3 * mesh.centres) == pytest.approx(order(np.array(wanted)), abs=1e-4)
    assert any("2 parts" in note and "1 of the others is left out" in note for note in mesh.notes)


def test_an_array_has_voxels_of_one_unit(tmp_path: Path) -> None:
    np.save(tmp_path / "organ.npy", labelled())
    mesh = ts.read_voxels(tmp_path / "organ.npy", 7, unit="mm")
    assert (mesh.upper - mesh.lower) == pytest.approx([2e-3, 2e-3, 2e-3])
    assert mesh.lower == pytest.approx([3.5e-3, -0.5e-3, -0.5e-3])


def test_a_mirrored_image_gives_a_body_that_is_not_inside_out(tmp_path: Path) -> None:
    import SimpleITK

    image = SimpleITK.GetImageFromArray(labelled().transpose())
    image.SetDirection([1.0, 0, 0, 0, 1, 0, 0, 0, -1])
    SimpleITK.WriteImage(image, str(tmp_path / "mirrored.nrrd"))
    mesh = ts.read_voxels(tmp_path / "mirrored.nrrd", 7)
    assert (mesh.measures > 0).all()
    assert mesh.upper[2] == pytest.approx(0.5e-3) and mesh.lower[2] == pytest.approx(-1.5e-3)


@pytest.mark.parametrize("edge", [1e-3, 0.7e-3, 0.4e-3])
def test_a_ball_keeps_its_volume_in_cubes_of_any_size(edge: float, tmp_path: Path) -> None:
    x = np.arange(60) - 29.5
    ball = (x[:, None, None] ** 2 + x[:, None] ** 2 + x**2 < 25**2).astype(np.int16)
    np.save(tmp_path / "ball.npy", ball)
    mesh = ts.read_voxels(tmp_path / "ball.npy", 1, edge=edge, unit="0.4 mm")
    sides = mesh.nodes[mesh.elements[:, 1]] - mesh.nodes[mesh.elements[:, 0]]
    assert np.linalg.norm(sides, axis=1) == pytest.approx(np.full(len(sides), edge))
    assert mesh.measures.sum() == pytest.approx(4 / 3 * np.pi * (25 * 0.4e-3) ** 3, rel=0.02)


def test_voxels_of_an_organ_are_solved_as_any_body(tmp_path: Path) -> None:
    study = tmp_path / "organ.toml"
    np.save(tmp_path / "organ.npy", np.ones((4, 2, 2), dtype=np.int8))
    study.write_text(
        """
        [mesh]
        voxels = "organ.npy"
        label = 1
        edge = "5 mm"
        unit = "10 mm"
        [material]
        young = "10 kPa"
        poisson = 0.25
        density = "1000 kg/m^3"
        [[support]]
        on = "left"
        [[load]]
        gravity = ["0 m/s^2", "-9.81 m/s^2", "0 m/s^2"]
        [models.springs]
        kind = "springs"
        rule = "isotropic"
        """
    )
    from truespring.study import read_study

    read = read_study(study)
    assert len(read.problem.mesh.elements) == 8 * 4 * 4
    assert read.problem.loading.external_force.sum(axis=0) == pytest.approx([0, -9.81 * 0.04 * 0.02 * 0.02 * 1000, 0])


def test_the_frog_comes_with_pyvista() -> None:
    labels = read_labels("pyvista:frog_tissues")
    assert labels.values.shape == (500, 470, 136)
    mesh = ts.read_voxels("pyvista:frog_tissues", 10, edge=5.354e-3, unit="mm")
    assert 1900 < len(mesh.elements) < 2100


# --- what is refused ----------------------------------------------------------------------------------------------


def blurred(folder: Path) -> Path:
    np.save(folder / "blurred.npy", labelled() * 0.37)
    return folder / "blurred.npy"


def cut_off(folder: Path) -> Path:
    file = written(folder, ".nrrd")
    file.write_bytes(file.read_bytes()[:-40])
    return file


def cut_vti(folder: Path) -> Path:
    file = written(folder, ".vti")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    return file


def flat(folder: Path) -> Path:
    np.save(folder / "flat.npy", np.ones((4, 4), dtype=int))
    return folder / "flat.npy"


def nothing(folder: Path) -> Path:
    (folder / "nothing.mha").write_bytes(b"")
    return folder / "nothing.mha"


def renamed(folder: Path) -> Path:
    (folder / "picture.png").write_bytes(b"x")
    return folder / "picture.png"


WRONG: dict[str, tuple[Callable[[Path], Path], dict[str, Any], str]] = {
    "no such label": (lambda at: written(at, ".nrrd"), {"label": 5}, r"no voxel has the label 5; there are 0, 4, 7"),
    "cubes too large": (lambda at: written(at, ".nrrd"), {"label": 7, "edge": 0.05}, "too large: no cube is filled"),
    "fractions": (blurred, {"label": 4}, "fractional values, not labels"),
    "truncated": (cut_off, {"label": 4}, "it is truncated: 6 x 5 x 4 voxels of 1 bytes are 120 bytes, .*80"),
    "truncated vti": (cut_vti, {"label": 4}, "organ.vti: "),
    "two axes": (flat, {"label": 1}, "three axes"),
    "empty": (nothing, {"label": 1}, "no MetaImage"),
    "no image": (renamed, {"label": 1}, "the suffix of a label image is"),
    "not there": (lambda at: at / "absent.nii", {"label": 1}, "does not exist"),
    "no edge": (lambda at: written(at, ".nrrd"), {"label": 7, "edge": -1.0}, "must be positive"),
    "no such frog": (lambda _: Path("pyvista:toad"), {"label": 1}, "no image of this name"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_organ_is_refused(name: str, tmp_path: Path) -> None:
    build, options, message = WRONG[name]
    with pytest.raises(TruespringError, match=message):
        ts.read_voxels(build(tmp_path), **options)


def test_a_body_one_cube_thick_is_noted(tmp_path: Path) -> None:
    np.save(tmp_path / "sheet.npy", np.ones((5, 4, 1), dtype=int))
    mesh = ts.read_voxels(tmp_path / "sheet.npy", 1)
    assert any("one cube thick along its z axis" in note for note in mesh.notes)
