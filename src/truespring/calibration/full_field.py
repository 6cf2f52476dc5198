"""Fit springs to full displacement fields: equilibrium is linear in the stiffness, even at large deformation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.calibration.cases import LoadCase
from truespring.calibration.unknowns import Unknowns
from truespring.equilibrium import State

# Up to so many matrix entries the equations are solved dense by an active set method, which is exact.
_DENSE = 20_000_000


@dataclass(frozen=True, eq=False)
class Equations:
    """Equilibrium at known displacements, A c = b, each row over the forces of its level.

    Attributes:
        matrix: sparse, shape (n_rows, n_unknowns).
        right: shape (n_rows,).
    """

    matrix: Any
    right: Floats

    @property
    def size(self) -> float:
        """The norm of the right side; 1 if it is zero, as when only an unknown force acts."""
        return float(np.linalg.norm(self.right)) or 1.0

    def residual(self, values: Floats) -> float:
        """Return the norm of the unbalanced force over `size` [-]."""
        return float(np.linalg.norm(self.matrix @ values - self.right)) / self.size


def equations(unknowns: Unknowns, cases: Sequence[LoadCase]) -> Equations | None:
    """Return the equilibrium equations of all full fields of the cases; None without full fields.

    There is one equation for each free degree of freedom, and one for each component of a moved support's force.
    """
    found = [part for case in cases for part in _of_case(unknowns, case)]
    if not found:
        return None
    return Equations(sparse.vstack([one[0] for one in found]).tocsr(), np.concatenate([one[1] for one in found]))


def _of_case(unknowns: Unknowns, case: LoadCase) -> list[tuple[Any, Floats]]:
    found = []
    whole = {one.level for one in case.observations if one.whole}
    for level in sorted(whole):
        assert case.field is not None  # its observations exist
        state = case.field[0].at(level)
        assert state is not None
        found.append(_at_level(unknowns, case, state, level))
    return found


def _at_level(unknowns: Unknowns, case: LoadCase, state: State, level: float) -> tuple[Any, Floats]:
    forces = unknowns.forces(state.positions)
    applied = case.problem.loading.force(state.positions, level).ravel() - unknowns.offset(state.positions)
    rows, right = [forces[case.free]], [applied[case.free]]
    for one in case.observations:
        if one.level == level and one.quantity != "displacement":
            rows.append(one.rows @ forces)
            right.append(one.data + one.rows @ applied)
    stacked = np.concatenate(right)
    scale = float(np.linalg.norm(stacked)) or float(np.linalg.norm(forces @ unknowns.start)) or 1.0
    return sparse.vstack(rows) / scale, stacked / scale


def fit_full_field(system: Equations, regularisation: float) -> Floats:
    """Return the unknowns c >= 0 that minimise |A c - b|^2 / |b|^2 + regularisation^2 |c - 1|^2 / n [-], shape (n,).

    Non-negative least squares (Lawson and Hanson 1974) with Tikhonov regularisation toward the rule.
    """
    from scipy.optimize import lsq_linear, nnls

    n = system.matrix.shape[1]
    weight = regularisation * system.size / np.sqrt(n)
    if system.matrix.shape[0] * n <= _DENSE:
        dense = np.concatenate([system.matrix.toarray(), weight * np.eye(n)])
        right = np.concatenate([system.right, np.full(n, weight)])
        reduced = np.asarray(np.linalg.qr(np.column_stack([dense, right]), mode="r"))
        return np.asarray(nnls(reduced[:, :n], reduced[:, n])[0])
    stacked = sparse.vstack([system.matrix, weight * sparse.eye_array(n)]).tocsr()
    right = np.concatenate([system.right, np.full(n, weight)])
    found = lsq_linear(stacked, right, bounds=(0.0, np.inf), lsmr_tol="auto", max_iter=50)
    return np.asarray(found.x)
