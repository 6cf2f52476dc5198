"""The unknowns of a calibration: factors c on parts of a model, where c = 1 is the rule."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints
from truespring.models import Model
from truespring.potential import Potential
from truespring.problem import Problem

#: A sparse matrix with a column for each unknown.
Columns = sparse.csr_array[Any, tuple[int, int]]


@dataclass(frozen=True, eq=False)
class Unknowns(ABC):
    """The unknowns of a calibration: non-negative factors, 1 is the rule.

    Attributes:
        kind: a key of UNKNOWNS.
        names: of the unknowns, of length n.
        problem: the body.
        of_what: what the unknowns are factors on, in words.
    """

    kind: str
    names: tuple[str, ...]
    problem: Problem

    of_what = "the rule"

    def __len__(self) -> int:
        return len(self.names)

    @property
    def start(self) -> Floats:
        """The rule: all ones [-], shape (n,)."""
        return np.ones(len(self))

    @property
    def counted(self) -> str:
        """The number of unknowns in words: "3 unknowns"."""
        return f"{len(self)} unknown{'s' * (len(self) != 1)}"

    @abstractmethod
    def model(self, values: Floats) -> Model:
        """Return the model with these unknowns (n,), which `solve` accepts for any problem on the same mesh."""

    @abstractmethod
    def potential(self, values: Floats) -> Potential:
        """Return the potential with these unknowns (n,); raise ModelError if there is none."""

    @abstractmethod
    def forces(self, positions: Floats, values: Floats | None = None) -> Columns:
        """Return the derivative of the internal force by each unknown [N], sparse, shape (n_dof, n).

        At `values`, by default those of the rule.
        """

    @abstractmethod
    def offset(self, positions: Floats) -> Floats:
        """Return the part of the internal force that no unknown scales [N], shape (n_dof,).

        The internal force is `forces(positions) @ values` plus this, exactly or to first order about the rule.
        """

    @abstractmethod
    def entry(self, study: dict[str, Any], name: str, values: Floats, files: Sequence[str]) -> dict[str, Any]:
        """Return the entry of the calibrated springs for the `[models]` of a study.

        Args:
            study: the tables of the study, which may be changed.
            name: of the springs of the rule in the study.
            values: the unknowns (n,).
            files: names of the files that `write` wrote.
        """

    def lattice(self, values: Floats) -> tuple[Ints, Floats] | None:
        """Return springs and their stiffness over that of the rule [-]; None if they have none of their own."""
        return None

    def write(self, values: Floats, file: Path, volume: Path) -> tuple[Path, ...]:
        """Write files that the study needs, named `file` and `volume`; return those written."""
        return ()

    def warnings(self, values: Floats) -> tuple[str, ...]:
        """Return warnings about the calibrated values (n,)."""
        return ()

    def sentence(self, values: Floats) -> str:
        """Return the parameters of the calibrated model as a sentence; empty if they are in files."""
        return ""


def material_name(number: int) -> str:
    """Return the name of a material in `Problem.materials`."""
    return f"region {number}" if number else "body"
