"""The choice among linear solvers."""

import importlib.util
from collections.abc import Callable, Sequence
from types import MappingProxyType
from typing import Any

from truespring.arrays import Bools, Floats
from truespring.errors import ProblemError, nearest, one_line
from truespring.linear.direct import FACTORISERS, Direct, direct_bytes, present
from truespring.linear.iterative import Multigrid
from truespring.linear.petsc import INSTALL, MODULES, Petsc
from truespring.linear.pressure import PressureMultigrid
from truespring.linear.protocols import LinearSolver as LinearSolver
from truespring.linear.protocols import Tangent as Tangent
from truespring.linear.unsymmetric import Gmres, Lu
from truespring.memory import available_memory
from truespring.potential import VolumeStiffness
from truespring.ranks import ALONE, Communicator, Layout, layout_alone, started_processes

# Largest number of free directions for which "auto" factorises, in the plane and in space: as fast as multigrid there.
_DIRECT = MappingProxyType({2: 8_000, 3: 1_000})


#: Allowed values of a solver's `linear`.
LINEAR = ("auto", "direct", "multigrid", "petsc", *FACTORISERS)


def check_linear(name: str) -> None:
    """Raise ProblemError if a linear solver does not exist or is not installed."""
    if name not in LINEAR:
        raise ProblemError(f"linear = '{name}' is unknown{nearest(name, LINEAR)}; allowed: {', '.join(LINEAR)}")
    if name in FACTORISERS and not present(name):
        raise ProblemError(f"linear = '{name}' is not installed; try: pip install {FACTORISERS[name].package}")
    missing = _missing(MODULES) if name == "petsc" else []
    if missing:
        raise ProblemError(f"linear = 'petsc' needs {' and '.join(missing)}; {INSTALL}")


def _missing(modules: Sequence[str]) -> list[str]:
    """Return those of some Python modules that are not installed."""
    return [name for name in modules if importlib.util.find_spec(name) is None]


def processes_of(name: str) -> Communicator:
    """Return the processes that share a body with the linear solver `name`: those of mpiexec with "petsc", else one.

    Raises ProblemError if the MPI library cannot be loaded.
    """
    if name != "petsc":
        return ALONE
    try:
        return started_processes()
    except (ImportError, RuntimeError) as error:  # as mpi4py raises
        raise ProblemError(f"linear = 'petsc': mpi4py does not load MPI ({one_line(str(error))}); {INSTALL}") from None


def choose(
    name: str,
    nodes: Floats,
    held: Bools,
    coarser: Callable[[], Sequence[Any]] = tuple,
    volumes: Callable[[Floats], Sequence[VolumeStiffness]] | None = None,
    layout: Layout | None = None,
    symmetric: bool = True,
) -> LinearSolver:
    """Return the linear solver `name`, one of LINEAR; "auto" chooses by size and dimension.

    `nodes` [m] and `held` have shape (n_nodes, dim). `coarser` returns the weights of the nodes from those of a coarser
    mesh, of these from a still coarser one, and so on, for multigrid: sparse, shape (n, n_coarse). `volumes` returns
    the stiffness against changes of volume at positions [m], see Volumetric. `layout` has the nodes of each process,
    for "petsc"; by default one process has all. `symmetric` states whether all tangents are symmetric.

    Raises ProblemError if a factorisation does not fit in memory, by estimate, and for "petsc" if tangents are not
    symmetric.
    """
    if name == "petsc" and not symmetric:
        raise ProblemError(
            "linear = 'petsc': solves symmetric systems only, and a pressure on an open surface has no symmetric "
            "tangent: use linear = 'auto', 'direct' or 'multigrid', hold the edge of the surface, or use a traction"
        )
    check_linear(name)
    n_free, dim = int((~held).sum()), nodes.shape[1]
    if name == "auto":
        name = "direct" if dim not in _DIRECT or n_free <= _DIRECT[dim] else "multigrid"
    if name == "petsc":
        return Petsc(held, layout or layout_alone(len(nodes)))
    if name == "multigrid":
        found = PressureMultigrid(nodes, held, coarser(), volumes) if volumes else Multigrid(nodes, held, coarser())
        return found if symmetric else Gmres(found, held)
    needed, there = direct_bytes(nodes.shape), available_memory()
    if needed > there:
        raise ProblemError(
            f"linear = '{name}': a factorisation for {len(nodes):,} nodes needs about {needed / 2**30:,.0f} GiB, "
            f"{there / 2**30:,.1f} GiB are available: use linear = 'multigrid' or fewer elements"
        )
    return Direct(held, name) if symmetric else Lu(held, name)
