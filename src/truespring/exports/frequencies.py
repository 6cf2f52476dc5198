"""Lowest and highest frequency of exported springs, for damping and time step of a simulation."""

from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.exports.features import Feature, features
from truespring.exports.whole import Whole
from truespring.linear import choose
from truespring.potential import SparseMatrix, volumes_of

# Up to this number of unknowns, all frequencies are computed by a dense solver; up to the second the lowest by a
# factorisation, beyond it by inverse iteration with the linear solver of Newton's method.
_FEW, _MANY = 100, 10_000
# Inverse iteration: largest number, relative change at its end, and accuracy of its linear systems.
_ITERATIONS, _ENOUGH, _ACCURACY = 30, 1e-2, 1e-3
# Relative accuracy of the highest eigenvalue.
_ROUGHLY = 1e-2
# Features of springs whose stiffness along their direction is constant and positive, and at least that across it.
_BOUNDED = frozenset({Feature.PRESTRESS, Feature.FOLLOWING})


def highest_frequency(whole: Whole, mass: Floats, start: Floats) -> float:
    """Return the highest frequency [rad/s] with masses of the nodes [kg], shape (n_nodes,); 1 if no node is free.

    Of straight springs in any position, by a bound; of others the highest of the undeformed body, at `start` and at the
    equilibrium.
    """
    exported, free = whole.exported, ~whole.held
    network = exported.springs.network
    if not free.any():
        return 1.0
    if network is not None and {one for one, _ in features(exported.problem, exported.springs)} <= _BOUNDED:
        # In any position the tangent of a spring is at most k [[I, -I], [-I, I]]; Gershgorin's circles bound the sum.
        around = np.bincount(network.springs.ravel(), np.repeat(network.stiffness, 2), len(mass))
        some = ~whole.held.all(axis=1)
        return float(np.sqrt((2 * around[some] / mass[some]).max(initial=0.0))) or 1.0
    root, here = _root(whole, mass)
    places = [whole.nodes, start, *([] if whole.positions is None else [whole.positions])]
    found = [
        _highest_eigenvalue(whole.potential.hessian(place), here, root)
        for place in places
        if np.isfinite(whole.potential.energy(place))
    ]
    return float(np.sqrt(max(found))) or 1.0


def lowest_frequency(whole: Whole, mass: Floats) -> float | None:
    """Return the lowest frequency at the equilibrium [rad/s], None if there is no stable equilibrium."""
    state, (root, free) = whole.exported.state, _root(whole, mass)
    if state is None or whole.positions is None or state.negative_eigenvalues or not free.size:
        return None
    tangent = whole.potential.hessian(whole.positions)
    lowest = _lowest_eigenvalue(tangent, free, root) if free.size <= _MANY else _iterated(whole, tangent, mass)
    return float(np.sqrt(lowest)) if lowest > 0 else None


def _root(whole: Whole, mass: Floats) -> tuple[Floats, Ints]:
    """Return M^1/2 on the free directions, and their numbers."""
    free = np.flatnonzero(~whole.held.ravel())
    return np.sqrt(np.repeat(mass, whole.held.shape[1])[free]), free


def _scaled(tangent: SparseMatrix, free: Ints, root: Floats) -> Any:
    """Return M^-1/2 K M^-1/2 on the free directions, sparse; `root` is M^1/2."""
    from scipy import sparse

    scale = sparse.diags_array(1 / root)
    return sparse.csc_array(scale @ sparse.csr_array(tangent)[free][:, free] @ scale)


def _lowest_eigenvalue(tangent: SparseMatrix, free: Ints, root: Floats) -> float:
    """Return the lowest eigenvalue of M^-1/2 K M^-1/2 on the free directions [1/s^2]; `root` is M^1/2."""
    from scipy.sparse.linalg import eigsh

    matrix = _scaled(tangent, free, root)
    if free.size <= _FEW:
        return float(np.linalg.eigvalsh(matrix.toarray())[0])
    first = np.random.default_rng(free.size).standard_normal(free.size)
    return float(eigsh(matrix, 1, sigma=0.0, v0=first, tol=1e-6, return_eigenvectors=False)[0])


def _highest_eigenvalue(tangent: SparseMatrix, free: Ints, root: Floats) -> float:
    """Return the highest eigenvalue of M^-1/2 K M^-1/2 on the free directions [1/s^2]; `root` is M^1/2."""
    from scipy.sparse.linalg import eigsh

    matrix = _scaled(tangent, free, root)
    if free.size <= _FEW:
        return float(np.linalg.eigvalsh(matrix.toarray())[-1])
    first = np.random.default_rng(free.size).standard_normal(free.size)
    return float(eigsh(matrix, 1, which="LA", v0=first, tol=_ROUGHLY, return_eigenvectors=False)[0])


def _iterated(whole: Whole, tangent: SparseMatrix, mass: Floats) -> float:
    """Return the lowest eigenvalue of M^-1 K by inverse iteration from the displacement of the equilibrium [1/s^2]."""
    assert whole.positions is not None
    linear = choose("auto", whole.nodes, whole.held, volumes=volumes_of(whole.potential))
    x, found, before = np.where(whole.held, 0.0, whole.positions - whole.nodes), 0.0, np.inf
    try:
        solver = linear.ready(tangent, whole.positions)
        for _ in range(_ITERATIONS):
            load = mass[:, None] * x / np.sqrt((mass[:, None] * x**2).sum())
            x = solver.solve(np.where(whole.held, 0.0, load), _ACCURACY)
            found = float((x * load).sum() / (mass[:, None] * x**2).sum())  # x K x is x times the load
            if abs(found - before) <= _ENOUGH * found:
                break
            before = found
    except ArithmeticError:  # not positive definite, or no solution
        return found
    return found
