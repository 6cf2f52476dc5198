"""JAX: the springs of Lloyd's rule in the plane, minimised by SciPy's L-BFGS. Run once, see recorded.json."""

import time
from importlib.metadata import version

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from benchmarks.cases import Case
from benchmarks.programs.common import TOLERANCE, Run, main, run_of

jax.config.update("jax_enable_x64", True)

# Of each square: its edges carry 5/16 E t, its diagonals 7/16 E t.
_LINKS = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)]
_STIFFNESS = np.array([5, 5, 5, 5, 7, 7]) / 16


def solve(case: Case) -> Run:
    """Minimise the energy over the free directions, scaled by the load over the length of the body."""
    pairs = np.sort(case.elements[:, _LINKS].reshape(-1, 2), axis=1)
    springs, place = np.unique(pairs, axis=0, return_inverse=True)
    stiffness = case.young * np.bincount(place.ravel(), np.tile(_STIFFNESS, len(case.elements)))
    rest = np.linalg.norm(case.nodes[springs[:, 1]] - case.nodes[springs[:, 0]], axis=1)
    free = np.flatnonzero(~case.held.ravel())
    total = float(np.linalg.norm(case.force.sum(axis=0)))

    @jax.jit
    @jax.value_and_grad
    def energy(moved):
        displacement = jnp.zeros(case.nodes.size).at[free].set(moved).reshape(case.nodes.shape)
        positions = case.nodes + displacement
        length = jnp.linalg.norm(positions[springs[:, 1]] - positions[springs[:, 0]], axis=1)
        return (jnp.sum(stiffness * (length - rest) ** 2) / 2 - jnp.sum(case.force * displacement)) / total

    start = np.zeros(len(free))
    energy(start)[0].block_until_ready()  # compiled before the clock runs
    started = time.perf_counter()
    options = {"maxiter": 10**6, "maxfun": 10**6, "ftol": 0.0, "gtol": TOLERANCE, "maxcor": 20}
    found = minimize(energy, start, jac=True, method="L-BFGS-B", options=options)
    seconds = time.perf_counter() - started
    displacement = np.zeros(case.nodes.size)
    displacement[free] = found.x
    residual = np.linalg.norm(found.jac) / np.linalg.norm(case.force / total)
    displacement = displacement.reshape(case.nodes.shape)
    notes = f"relative residual {residual:.0e}"
    return run_of(case, version("jax"), displacement, found.nit, seconds, notes=notes)


if __name__ == "__main__":
    main(solve)
