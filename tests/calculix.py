"""Running decks in CalculiX: what it prints, read back.

CalculiX is a finite element program of its own (Dhondt and Wittig, https://www.calculix.de), called as a process.
"""

import shutil
from pathlib import Path

import pytest

from truespring.arrays import Floats
from truespring.reference.ccx import run_ccx
from truespring.reference.dat import read_dat

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")


def displacements(deck: str, folder: Path) -> list[Floats]:
    """Run `deck` in `folder` and return the displacement at the end of each step [m], shape (n_nodes, 3)."""
    file = folder / "twin.inp"
    file.write_text(deck)
    finished = run_ccx(file, threads=1)
    assert finished.code == 0, finished.errors
    return [level.displacement for level in read_dat(file.with_suffix(".dat")).levels]


def displacement(deck: str, folder: Path) -> Floats:
    """Run `deck` in `folder` and return the displacement at the end of its last step [m], shape (n_nodes, 3)."""
    return displacements(deck, folder)[-1]
