"""The files of a calibrated study: a study with its springs in a file, values, figures and a page."""

import copy
import os
import re
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from truespring.calibration.files import NAME, write_fitted
from truespring.calibration.fitted_study import FittedStudy
from truespring.calibration.page import calibration_values, fitted_sentence
from truespring.errors import StudyError
from truespring.outputs import Output
from truespring.study import schema
from truespring.study.read import Study
from truespring.study.toml import toml_text

# Keys of [mesh] and of models that name files.
_MESH_FILES, _MODEL_FILES = ("file", "voxels", "nodes", "springs"), ("file", "undeformed")


def calibrated_values(found: FittedStudy) -> dict[str, Any]:
    """Return a calibration of a study as JSON values."""
    return {
        "title": found.study.title,
        "truespring": version("truespring"),
        "study": str(found.study.file),
        "springs": found.springs,
        "reference": found.reference,
        **calibration_values(found.calibration),
    }


def write_calibrated(found: FittedStudy, out: Path, command: str | None) -> tuple[Path, ...]:
    """Write calibrated.toml, its springs as CSV, calibrate.json, figures and report.html into out/STEM; return them."""
    with Output(out / found.study.stem, "calibrate.json") as output:
        files = _write(found, output, command)
        output.publish()
    return tuple(output.folder / file.name for file in files)


def _write(found: FittedStudy, output: Output, command: str | None) -> tuple[Path, ...]:
    study = output.staging / f"{NAME}.toml"
    words = found.study.title, what_was_fitted(found)
    files = write_fitted(found.calibration, output.staging, calibrated_values(found), words, (study.name,), command)
    tables = [file.name for file in files if file.suffix == ".csv"]
    study.write_text(calibrated_study(found, output.folder, tables), encoding="utf-8")
    return study, *files


def what_was_fitted(found: FittedStudy) -> str:
    """Return a sentence on what was fitted to what."""
    fitted = found.calibration
    loads = ", ".join(one.case.name for one in fitted.cases if not one.held_out)
    return (
        f"{fitted.rule.label[:1].upper()}{fitted.rule.label[1:]} with {fitted.unknowns.counted} by "
        f"{fitted.unknowns.kind}, fitted to {found.reference} under {loads}."
    )


def calibrated_study(found: FittedStudy, folder: Path, tables: list[str]) -> str:
    """Return the text of the study, to be written into `folder`, with the calibrated springs as a further model.

    The comments at its head give the errors: they are shown with its results and copied into exported files.
    """
    study = _tables(found.study)
    study["title"] = f"{found.study.title}, springs calibrated"
    _move(study.get("mesh", {}), _MESH_FILES, found.study.file.parent, folder)
    for model in study["models"].values():
        _move(model, _MODEL_FILES, found.study.file.parent, folder)
        own = model.get("stiffness")
        if isinstance(own, dict):
            _move(own, ("file", "volume"), found.study.file.parent, folder)
    name = _free_name(study["models"])
    entry = found.calibration.unknowns.entry(study, found.springs, found.calibration.values, tables)
    study["models"] = {name: entry, **study["models"]}
    compare = dict(study.get("compare", {}))
    references = [one for one in compare.get("references", found.study.references) if one != name]
    if found.reference in study["models"] and found.reference not in references:
        references.append(found.reference)
    study["compare"] = {**compare, "model": name, "references": references}
    return "".join(f"# {line}\n" for line in _head(found)) + "\n" + toml_text(study)


def _tables(study: Study) -> dict[str, Any]:
    """Return the tables of a study as read, with the number of elements of its mesh."""
    tables = copy.deepcopy(dict(study.text.document))
    if study.halvings:
        if not isinstance(study.keys.mesh, schema.ShapeKeys):
            raise StudyError(f"{study.file}: mesh: a refined mesh from a file cannot be written into a study")
        tables["mesh"]["elements"] = list(study.keys.mesh.elements)
    return tables


def _head(found: FittedStudy) -> list[str]:
    """Return the lines of comment at the head of the study: origin, errors and identifiability of the springs."""
    fitted = found.calibration
    lines = [
        f"Springs calibrated by truespring {version('truespring')}: {what_was_fitted(found)}",
        fitted_sentence(fitted),
        *filter(None, [fitted.unknowns.sentence(fitted.values)]),
        fitted.headline,
        fitted.identifiability.sentence,
    ]
    return [" ".join(line.split()) for line in lines]


def _free_name(models: Mapping[str, Any]) -> str:
    """Return a name that is not used in the study."""
    taken = {name.casefold() for name in models}
    numbers = ("", *(f"-{number}" for number in range(2, len(taken) + 3)))
    return next(f"{NAME}{number}" for number in numbers if f"{NAME}{number}" not in taken)


def _move(table: dict[str, Any], keys: tuple[str, ...], before: Path, now: Path) -> None:
    """Adapt the relative paths of files in a table to the new folder of the study."""
    for key in keys:
        name = table.get(key)
        if isinstance(name, str) and not re.match(r"\w\w+:", name):
            table[key] = Path(os.path.relpath((before / name).resolve(), now.resolve())).as_posix()
