"""CalculiX: NLGEOM, which makes *ELASTIC the St. Venant-Kirchhoff law; its own direct solver on all threads.

Elements in space are C3D8, C3D8I (incompatible modes) or C3D20R (20 nodes, reduced integration). Plane stress of a
quadratic law is plane strain of another material, and as such is given to elements CPE4: the very problem that the
others solve. CPS4, one layer of bricks with free faces, is another one.
"""

import os
import pty
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.cases import Case, serendipity
from benchmarks.programs.common import Attempt, Run, in_few_increments, main, peak_bytes

# By default it stops at a residual of 0.5 % of the mean force and a correction of 1 % of the displacement.
_CONTROLS = "*CONTROLS, PARAMETERS=FIELD\n1.E-7, 1.E-7"


def solve(case: Case, element: str) -> Run:
    """Solve in one load increment, or in as few more as it takes."""
    if shutil.which("ccx") is None:
        raise SystemExit("ccx is not installed: apt-get install calculix-ccx")
    version = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout.split()[-1]
    case = serendipity(case) if element == "C3D20R" else case
    with tempfile.TemporaryDirectory() as folder:
        twin = Twin(case, element, Path(folder))
        return replace(in_few_increments(case, version, twin.attempt), peak_bytes=twin.peak_bytes)


class Twin:
    """The deck of a case and what running it gave."""

    def __init__(self, case: Case, element: str, folder: Path) -> None:
        self.case, self.element, self.folder, self.peak_bytes = case, element, folder, 0

    def attempt(self, increments: int) -> Attempt | None:
        """Return displacement, iterations and seconds, from when the deck is read; None where it did not converge."""
        (self.folder / "twin.inp").write_text("\n".join(deck(self.case, self.element, increments)))
        read, ended, converged = self._run()
        if not converged:
            return None
        rows = np.loadtxt(self.folder / "twin.dat", skiprows=3)
        displacement = np.zeros_like(self.case.nodes)
        displacement[rows[:, 0].astype(int) - 1] = rows[:, 1 : 1 + self.case.dim]
        steps = np.loadtxt(self.folder / "twin.sta", skiprows=2, ndmin=2)
        return displacement, int(steps[:, 3].sum()), ended - read

    def _run(self) -> tuple[float, float, bool]:
        """Run ccx; return when it had read its deck, when it ended, and whether it converged.

        What it prints comes line by line to a terminal only.
        """
        ours, theirs = pty.openpty()
        process = subprocess.Popen(["ccx", "twin"], cwd=self.folder, stdout=theirs, stderr=theirs)
        os.close(theirs)
        read, printed = None, b""
        for chunk in _chunks(ours):
            printed += chunk
            if read is None and b"Determining the structure of the matrix" in printed:
                read = time.perf_counter()
            self.peak_bytes = max(self.peak_bytes, peak_bytes(process.pid))
        return read or 0.0, time.perf_counter(), process.wait() == 0


def _chunks(terminal: int) -> Iterator[bytes]:
    """What comes from a terminal until the process at its other end is gone."""
    while True:
        try:
            chunk = os.read(terminal, 65536)
        except OSError:  # how Linux says so
            chunk = b""
        if not chunk:
            os.close(terminal)
            return
        yield chunk


def deck(case: Case, element: str, increments: int) -> Iterator[str]:
    """Yield the lines of the input."""
    young, poisson = case.young, case.poisson
    if case.dim == 2:  # Timoshenko and Goodier, Theory of Elasticity: the exchange between the plane problems
        young, poisson, element = young * (1 + 2 * poisson) / (1 + poisson) ** 2, poisson / (1 + poisson), "CPE4"
    yield "*NODE"
    yield from (f"{number}, {_joined(node)}" for number, node in enumerate(case.nodes.tolist(), 1))
    yield f"*ELEMENT, TYPE={element}, ELSET=BODY"
    yield from (f"{number}, {_broken(row)}" for number, row in enumerate((case.elements + 1).tolist(), 1))
    yield "*NSET, NSET=SHOWN"
    yield from (f"{node + 1}," for node in np.flatnonzero(case.force.any(axis=1) | case.at_samples))
    yield f"*MATERIAL, NAME=M\n*ELASTIC\n{young:.12e}, {poisson:.12e}"
    yield "*SOLID SECTION, ELSET=BODY, MATERIAL=M" + ("\n1." if case.dim == 2 else "")
    yield f"*STEP, NLGEOM, INC={increments}\n{_CONTROLS}\n*STATIC, DIRECT\n{1 / increments:.12e}, 1.\n*BOUNDARY"
    yield from (f"{node + 1}, {axis + 1}, {axis + 1}" for node, axis in np.argwhere(case.held))
    yield "*CLOAD"
    yield from (f"{node + 1}, {axis + 1}, {case.force[node, axis]:.12e}" for node, axis in np.argwhere(case.force))
    yield f"*NODE PRINT, NSET=SHOWN, FREQUENCY={increments}\nU\n*END STEP\n"


def _broken(nodes: list[int]) -> str:
    """ccx reads sixteen numbers of a line: the nodes of a large element take two."""
    lines = [nodes[:15], nodes[15:]]
    return ",\n".join(_joined(line) for line in lines if line)


def _joined(values: list) -> str:
    """ccx reads twenty characters of a number."""
    return ", ".join(f"{value:.12e}" if isinstance(value, float) else str(value) for value in values)


if __name__ == "__main__":
    main(partial(solve, element=sys.argv[2]), {})
