"""Read several studies, and check all of them before any is solved."""

from collections.abc import Sequence
from pathlib import Path

from truespring.errors import StudyError
from truespring.study.read import Study, read_text


def read_studies(files: Sequence[str | Path], balanced: bool = True) -> list[Study]:
    """Read and check studies; raise StudyError with the errors of all of them, or if two files have the same stem.

    `balanced` is that of `StudyText.study`.
    """
    studies: list[Study] = []
    faults: list[str] = []
    seen: dict[str, str | Path] = {}
    for file in files:
        stem = Path(file).stem.casefold()
        if stem in seen:
            faults.append(
                f"{file} and {seen[stem]} have the same stem, '{stem}', so they share an output folder: rename one"
            )
        seen[stem] = file
        try:
            studies.append(read_text(file).study(balanced=balanced))
        except StudyError as error:
            faults.append(str(error))
    if faults:
        raise StudyError("\n".join(faults))
    return studies
