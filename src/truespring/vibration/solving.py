"""modes(problem, model) -> Modes: natural frequencies of a body."""

import time
from collections.abc import Iterator

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError, ProblemError
from truespring.linear import check_linear
from truespring.models import Model, as_model, check_fibres
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.program import Program
from truespring.vibration.eigen import lowest, size_of
from truespring.vibration.result import Modes
from truespring.vibration.system import System, system_of

# Eigenvalues below this share of the largest are rounding errors of zero.
_ZERO = 1e-13
# Largest unbalanced force of an undeformed body over its largest stiffness times its size.
_BALANCED = 1e-9


def modes(problem: Problem, model: Model | Potential, count: int = 6, linear: str = "auto") -> Modes:
    """Return the lowest natural frequencies and shapes of small vibrations about the undeformed body.

    Args:
        problem: the body with its supports, and with a density; loads are not applied. A body without loads, or without
            supports, is stated by `Problem(..., stated=False)`, or has `dynamics`.
        model: Springs, Fem, any object with a method `potential(problem)`, or a potential.
        count: number of modes beside rigid-body motions; fewer if the body has fewer.
        linear: linear solver that LOBPCG is preconditioned with, see `Newton`; small systems are solved densely.

    Raises ProblemError without a density, and ModelError if the model does not fit the problem.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.16, 0.04), (8, 2)),
        ...     ts.Material(young=10e3, poisson=0.3, density=1000.0),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     stated=False,
        ... )
        >>> ts.modes(problem, ts.Springs("gaussian"), count=2).frequencies.round(2).tolist()  # [Hz]
        [0.74, 3.76]
    """
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise ProblemError(f"count = {count!r}: must be a positive number of modes")
    model = as_model(model)
    check_linear(linear)
    check_fibres(problem, model)
    if not can_vibrate(model):
        raise ModelError(f"{model.label}: modes need a potential, and another program has none: use another model")
    started = time.perf_counter()
    potential = model.potential(problem)
    system = system_of(problem, potential)
    if system.rigid.shape[1] == system.matrix.shape[0]:
        raise ModelError(f"{model.label}: all motions that supports leave are rigid-body motions: nothing vibrates")
    found = lowest(system.matrix, system.rigid, lambda: system.inverse(problem, potential, linear), int(count))
    zero = np.abs(found.values) <= _ZERO * size_of(system.matrix)
    values = np.where(zero, 0.0, found.values)
    shapes = system.shapes(found.vectors)
    own = shapes[:, : problem.mesh.n_nodes]
    largest = _largest(own)
    with np.errstate(divide="ignore", invalid="ignore"):
        residuals = np.where(zero, 0.0, found.residuals / np.abs(values))
    converged = bool((found.converged | zero).all())
    return Modes(
        problem=problem,
        label=model.label_on(problem),
        has_springs=model.has_springs,
        potential=potential,
        eigenvalues=values,
        shapes=own / largest[:, None, None],
        modal_mass=1 / largest**2,
        n_rigid=system.rigid.shape[1],
        residuals=residuals,
        converged=converged,
        n_unknowns=system.matrix.shape[0],
        method=found.method,
        seconds=time.perf_counter() - started,
        warnings=(*model.warnings(problem), *_warnings(system, values, converged)),
    )


def can_vibrate(model: Model) -> bool:
    """Return whether a model has a potential, unlike another program and a solution from a file."""
    return not isinstance(model, Program)


def _largest(shapes: Floats) -> Floats:
    """Return the component of the largest size of each shape, with its sign, shape (n,)."""
    flat = shapes.reshape(len(shapes), -1)
    at = np.abs(flat).argmax(axis=1)
    return np.asarray(flat[np.arange(len(flat)), at])


def _warnings(system: System, values: Floats, converged: bool) -> Iterator[str]:
    if system.unbalanced > _BALANCED:
        yield (
            "the undeformed body is not in equilibrium by this model, as if it had springs under tension: frequencies "
            "are those of its tangent there"
        )
    if (values == 0).any():
        yield (
            f"{int((values == 0).sum())} modes that are not rigid-body motions have no stiffness: this model is a "
            "mechanism"
        )
    if (values < 0).any():
        yield (
            f"the undeformed body is unstable by this model: omega^2 is negative for {int((values < 0).sum())} of "
            f"{len(values)} modes"
        )
    elif not converged:
        yield "not all modes are accurate: LOBPCG did not converge; try linear = 'direct', or fewer modes"
