"""The result of solve: a Solution, its States, and the Status in which it ended."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.conditions import Refined, Touch
from truespring.dynamics import Moving
from truespring.mesh import Grid, Shell, Surface
from truespring.models import Moduli
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.reactions import SupportForce, leading_support, support_forces
from truespring.solvers import Cost

if TYPE_CHECKING:
    import pyvista
    import xarray
    from matplotlib.axes import Axes

#: Levels closer than this are equal: other programs print six digits.
SAME_LEVEL = 2e-6


class Status(StrEnum):
    """How a solution ended; `advice` explains it and suggests a remedy.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> status = ts.solve(problem, ts.Springs("gaussian")).status
        >>> status is ts.Status.CONVERGED
        True
        >>> ts.Status.UNSTABLE.advice
        'a real body would leave such a state; reduce the load, or add a small side force to choose a branch'
    """

    CONVERGED = "converged"
    UNSTABLE = "unstable"
    INVERTED = "inverted"
    NOT_CONVERGED = "not-converged"
    READ = "read"
    FIXED_ITERATIONS = "fixed-iterations"

    @property
    def advice(self) -> str:
        """Explanation of the status, and a remedy."""
        return _ADVICE[self]


#: Statuses without trouble.
FINE = (Status.CONVERGED, Status.READ, Status.FIXED_ITERATIONS)

_ADVICE = {
    Status.CONVERGED: "an equilibrium was found at every load level, and none is known to be unstable",
    Status.UNSTABLE: "a real body would leave such a state; reduce the load, or add a small side force to choose a "
    "branch",
    Status.INVERTED: "an element is inverted, at a corner at least; reduce the load, use more load_steps or a finer "
    "mesh, or with rule = 'gaussian' a larger hourglass: other springs and St. Venant-Kirchhoff resist no inversion",
    Status.FIXED_ITERATIONS: "each time step ended after a fixed number of iterations, not converged, as in real time",
    Status.READ: "read from a file, which does not state whether it converged",
    Status.NOT_CONVERGED: "no equilibrium was found beyond the last level reached; reduce the load, use more "
    "load_steps or another law: each has a largest load",
}


@dataclass(frozen=True, repr=False)
class State:
    """An equilibrium of a body.

    Attributes:
        load_factor: share of the full load [-].
        positions, displacement: [m], shape (n_nodes, dim).
        all_positions: of all nodes of the potential, the mesh's first [m], shape (n_all, dim); quadratic elements have
            more nodes than the mesh.
        reaction: force of the supports [N], shape (n_nodes, dim), zero in free directions.
        applied_force: total of loads, tools and grasps [N], shape (dim,).
        energy: stored elastic energy [J].
        iterations: Newton iterations.
        residual: relative unbalanced force [-].
        negative_eigenvalues: number of negative eigenvalues of the tangent: 0 if stable, None if not known.
        branched: true if the solver left an unstable equilibrium for a stable one nearby.
        snapped: true if the body moved much further than the previous step suggests.
        critical: "limit point" or "bifurcation" if stability changes at this state, else None.
        mode: buckling mode of a critical point, largest component 1 [-], shape (n_nodes, dim); None of other states.
        level: share of the controlled quantity, 0 to 1: the load factor under load control, the share of the
            displacement under displacement control; None at a critical point, which lies between levels.
        area_ratio: smallest corner Jacobian over its undeformed value [-]; an element is inverted if not positive.
        stretch: smallest and largest length over rest length of the springs [-], None without springs.
        supports: force and torque of each moved support, if they do not follow from the reactions (read from a file,
            or interpolated on another mesh), else None; see Solution.support_forces.
        reason: why the solver did not look for equilibria beyond this state, else empty.
        touches: what each tool and grasp of the problem does, in their order; empty if not known.
        moving: time, velocity and energies of a state of a motion, None at rest.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> state = ts.solve(problem, ts.Springs("gaussian")).states[-1]
        >>> state.load_factor, state.negative_eigenvalues
        (1.0, 0)
        >>> state.reaction.sum(axis=0).round(6).tolist()
        [-0.1, 0.0]
    """

    load_factor: float
    positions: Floats
    all_positions: Floats
    displacement: Floats
    reaction: Floats
    applied_force: Floats
    energy: float
    iterations: int
    residual: float
    negative_eigenvalues: int | None
    branched: bool
    area_ratio: float
    stretch: tuple[float, float] | None
    snapped: bool = False
    critical: str | None = None
    mode: Floats | None = None
    level: float | None = None
    supports: tuple[SupportForce, ...] | None = None
    reason: str = ""
    touches: tuple[Touch, ...] = ()
    moving: Moving | None = None

    @property
    def loaded(self) -> bool:
        """Whether the level is above zero."""
        return self.level is not None and self.level > 0

    def __repr__(self) -> str:
        return (
            f"State(load_factor={self.load_factor:g}, energy={self.energy:.6g} J, iterations={self.iterations}, "
            f"negative_eigenvalues={self.negative_eigenvalues}, area_ratio={self.area_ratio:.3g})"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """The equilibria of a model of a problem, by load level.

    Attributes:
        problem: the problem that was solved.
        label: name in figures and tables.
        kind: kind of the model, such as "springs" or "calculix", see Model.kind; of a file its format, such as "frd".
        states: equilibria in the order of the path, the unloaded state first; of a file with one level, that alone.
        best: if a level was not reached, the state of least residual there (not an equilibrium), else None.
        status, warnings: how it ended, and limits to its validity.
        seconds: wall time from the built mesh to the last equilibrium [s].
        surface, shell: deformed surface, in the plane or in space, of a file with no more than that.
        grid: points and cells of a solution that was read, the mesh's nodes first; `all_positions` of the states are
            the positions of these points. None if the elements of the mesh interpolate.
        potential: potential that was solved, None if another program solved it.
        moduli: effective moduli for the problem's material, None for other models and networks.
        finite: whether strains are finite, false for a linear theory; None if not known, as of a file.
        has_springs: whether the potential consists of springs, see Model.
        element: interpolation of finite elements, one of ELEMENTS; None of other models.
        lines: name of the lines that figures draw, see Model.
        n_unknowns: number of free directions of all nodes, 0 if nothing was solved.
        cost: methods and costs of the solver, None if nothing was solved here.
        held: directions that supports hold, shape (n_nodes, dim), if the file gives them; else None.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.16, 0.04), (16, 4)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.0, -0.043))],
        ... )
        >>> reference = ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(load_steps=2))
        >>> solution = ts.solve(problem, ts.Springs("gaussian"), ts.Newton(load_steps=2))
        >>> solution
        Solution(springs (gaussian), converged, 3 states up to load factor 1)
        >>> solution.states[-1].displacement.shape
        (85, 2)
    """

    problem: Problem
    label: str
    kind: str
    states: tuple[State, ...]
    status: Status
    warnings: tuple[str, ...] = ()
    seconds: float = 0.0
    best: State | None = None
    surface: Surface | None = None
    shell: Shell | None = None
    grid: Grid | None = None
    potential: Potential | None = None
    moduli: Moduli | None = None
    finite: bool | None = None
    has_springs: bool = False
    element: str | None = None
    lines: str = "springs"
    n_unknowns: int = 0
    cost: Cost | None = None
    held: Bools | None = None

    def __repr__(self) -> str:
        return (
            f"Solution({self.label}, {self.status}, {len(self.states)} states up to load factor {self.load_factor:g})"
        )

    @cached_property
    def load_factors(self) -> Floats:
        """Load factors of the states [-], shape (n_states,)."""
        return np.array([state.load_factor for state in self.states])

    @cached_property
    def whole(self) -> Grid:
        """All points, those of the mesh first, and the cells that interpolate between them."""
        mesh = self.problem.mesh
        if self.grid is not None:
            return self.grid
        if isinstance(self.potential, Refined):
            elements = self.potential.elements
            return Grid(self.potential.nodes, {f"{mesh.kind.vtk}{elements.shape[1]}": elements})
        return Grid(mesh.nodes, {} if mesh.element == "line" else mesh.cells)

    @property
    def is_cloud(self) -> bool:
        """Whether it was read as points without cells; the lines of its mesh then have no meaning."""
        return self.grid is not None and not self.grid.cells

    @property
    def load_factor(self) -> float:
        """The last load factor reached; of a surface that was read, the load factor of the file."""
        if self.states:
            return self.states[-1].load_factor
        only = self.surface or self.shell
        return only.load_factor if only else 0.0

    @property
    def complete(self) -> bool:
        """Whether the full load, or the full controlled displacement, was reached."""
        return bool(self.states and self.states[-1].level == 1.0) or (not self.states and self.load_factor == 1.0)

    @property
    def solved(self) -> bool:
        """Whether it was solved in this run, by this or another program, not read from a file."""
        return self.potential is not None or self.n_unknowns > 0

    @property
    def newton_iterations(self) -> int:
        """The number of all Newton iterations."""
        return sum(state.iterations for state in self.states) + (self.best.iterations if self.best else 0)

    def at(self, level: float | None) -> State | None:
        """Return the state at a level (see State.level); None if there is none, or if `level` is None."""
        if level is None:
            return None
        distances = {abs(state.level - level): state for state in reversed(self.states) if state.level is not None}
        return distances[min(distances)] if distances and min(distances) <= SAME_LEVEL else None

    @cached_property
    def prescribed(self) -> Bools | None:
        """True for nodes that supports prescribe in all directions, shape (n_nodes,); None if supports are unknown."""
        if self.held is not None:
            return np.asarray(self.held.all(axis=1))
        return np.asarray(self.problem.loading.held.all(axis=1)) if self.problem.stated else None

    def support_forces(self, state: State) -> tuple[SupportForce, ...]:
        """Return force and torque of each moved support at a state; empty if none moves or they are not known."""
        if state.supports is not None:
            return state.supports
        if not self.problem.stated or not np.isfinite(state.reaction).all():
            return ()
        return support_forces(self.problem, state.positions, state.reaction, state.load_factor)

    @cached_property
    def _leading(self) -> int | None:
        return leading_support(self.problem)

    def applied_force(self, state: State) -> Floats:
        """Return the total force of loads, tools and grasps [N], shape (dim,).

        Without any, it is the force of the support that moves most; of supports that move equally far, the first one
        counts. NaN if it is not known.
        """
        loading = self.problem.loading if self.problem.stated else None
        if loading is None or loading.interactions or not loading.driven_by_motion:
            return state.applied_force
        of_leading = [one.force for one in self.support_forces(state) if one.support == self._leading]
        return of_leading[0] if of_leading else np.full(self.problem.mesh.dim, math.nan)

    def write(self, file: str | Path, level: int = -1) -> Path:
        """Write the solution to a file, in SI units; its suffix selects the format.

        .pvd: all states, one .vtu each, for ParaView, as `truespring verify` writes them. .vtkhdf: the same as one file
        of HDF5, with the undeformed body once (pip install 'truespring[vtkhdf]'). .vtu: the undeformed body with the
        fields of one state. .stl: the deformed body of one state. .csv: position and displacement of all nodes at all
        states, with units in the header line; `truespring compare` and `read_result` read it.

        Args:
            file: the file; its folder is created.
            level: number of the state of a .vtu or .stl file, counted from the end if negative.

        Returns the path of the file. Raises OutputError for another suffix or level.

        Example:
            >>> solution.write("bent.pvd").name
            'bent.pvd'
            >>> print(ts.compare(solution, ts.read_result(solution.write("bent.csv"))))
            springs (gaussian) against bent.csv: 0.0% rms at full load, within 5% up to load factor 1
        """
        from truespring.showing.writing import write_solution

        return write_solution(self, Path(file), level)

    def to_pyvista(self, level: int = -1, warped: bool = True) -> "pyvista.UnstructuredGrid":
        """Return a state as a grid of PyVista with the fields of the .vtu files.

        Points have `displacement` [m] and `reaction` [N]; springs have `tension` [N], `stretch` [-] and `stiffness`
        [N/m], elements `stress` [Pa] and `strain_energy` [J], as far as the model has them; NaN elsewhere.

        Args:
            level: number of the state, counted from the end if negative.
            warped: whether points are the deformed positions [m]; else the undeformed ones.

        Raises OutputError if there is no such state or PyVista is not installed.

        Example:
            >>> grid = solution.to_pyvista()
            >>> grid["displacement"].shape, grid["stress"].shape
            ((85, 3), (340, 9))
        """
        from truespring.showing.grids import solution_grid

        return solution_grid(self, level, warped)

    def table(self, probe: int | str | Sequence[float] | None = None) -> Any:
        """Return a table with one row for each state: a pandas DataFrame, of polars if pandas is not installed.

        Columns: load_factor, in a motion time [s], displacement of the probe ux, uy[, uz] [m], applied force fx, fy[,
        fz] [N], energy [J], smallest and largest stretch of the springs, area_ratio, iterations, residual, and state:
        stable, unstable, the kind of a critical point, or empty if not known. The units are in `attrs["units"]` of a
        pandas table.

        Args:
            probe: number of a node, a point such as "right-middle", or a position [m], whose nearest node is taken; by
                default the node that moves most.

        Raises OutputError if neither library is installed or the solution has no states, MeshError if there is no such
        node.

        Example:
            >>> table = solution.table(probe="right-middle")
            >>> table[["load_factor", "fy", "state"]]
               load_factor      fy   state
            0          0.0  0.0000  stable
            1          0.5 -0.0215  stable
            2          1.0 -0.0430  stable
            >>> table.attrs["units"]["uy"]
            'm'
        """
        from truespring.showing.tables import table_of

        return table_of(self, probe)

    def to_xarray(self) -> "xarray.Dataset":
        """Return the states as arrays over level, node and component, with units in their attributes.

        Variables are displacement [m], reaction [N], applied_force [N], energy [J] and, of a motion, velocity [m/s];
        coordinates are the load_factor of the levels, of a motion their time [s], and x, y[, z] of the nodes [m].

        Raises OutputError if xarray is not installed or the solution has no states.

        Example:
            >>> arrays = solution.to_xarray()
            >>> tip = arrays.displacement.where(arrays.x > 0.159, drop=True).mean("node")
            >>> tip.sel(component="y").dims
            ('level',)
        """
        from truespring.showing.tables import arrays_of

        return arrays_of(self)

    def _repr_html_(self) -> str:
        """Return the solution as HTML for a notebook: a table and a picture."""
        from truespring.showing.values import html_of

        return html_of(self)

    def plot(
        self,
        over: "Solution | None" = None,
        color: str | None = None,
        level: int = -1,
        ax: "Axes | None" = None,
        magnify: float | None = None,
    ) -> "Axes":
        """Draw a state by matplotlib: springs in blue over a reference in black, or in colours.

        Data of the axes are in metres, numbers are written in a unit that fits. In space the body is an image.

        Args:
            over: a reference, such as a solution by finite elements.
            color: "distance" from the reference, "displacement", "stretch", "stress" (von Mises) or "tension".
            level: number of the state, counted from the end if negative; with a reference, among the states at levels
                that both have.
            ax: axes to draw in; by default those of a new figure.
            magnify: factor of the displacements, by default 1 unless they are too small to see.

        Returns the axes. Raises OutputError if the solution does not have the level or the quantity.

        Example:
            >>> axes = solution.plot(over=reference)
            >>> axes = solution.plot(color="stress")
            >>> axes.figure.savefig("stress.png")
        """
        from truespring.showing.plotting import plot_solution

        return plot_solution(self, over, color, level, magnify, ax)

    def animate(self, file: str | Path, over: "Solution | None" = None, color: str | None = None) -> Path:
        """Write an animation of the states as .gif or .mp4.

        Args:
            file: the file; its folder is created. MP4 needs imageio-ffmpeg.
            over: a reference, drawn in black.
            color: quantity that colours show, see `plot`; the same in all frames.

        Returns the path of the file. Raises OutputError for another suffix, a quantity that the solution does not
        have, fewer than two levels, or if ffmpeg fails.

        Example:
            >>> solution.animate("bent.gif", over=reference).name
            'bent.gif'
        """
        from truespring.showing.films import animate

        return animate(self, Path(file), over, color)
