"""Several studies of one command: all are checked before any is solved."""

from collections.abc import Sequence
from pathlib import Path

from truespring.errors import StudyError
from truespring.study.read import Study, read_study


def read_studies(files: Sequence[str | Path]) -> list[Study]:
    """Read and check all studies before any is solved; raise StudyError with the faults of all of them."""
    studies: list[Study] = []
    faults: list[str] = []
    seen: dict[str, str | Path] = {}
    for file in files:
        stem = Path(file).stem.casefold()
        if stem in seen:
            faults.append(f"{file} and {seen[stem]} have one stem, '{stem}': their outputs would share a folder")
        seen[stem] = file
        try:
            studies.append(read_study(file))
        except StudyError as error:
            faults.append(str(error))
    if faults:
        raise StudyError("\n".join(faults))
    return studies
