"""Solvers: compute equilibria of a potential under a loading."""

from truespring.solvers.balance import Equilibrium as Equilibrium
from truespring.solvers.balance import Reporter as Reporter
from truespring.solvers.continuation import ArcLength as ArcLength
from truespring.solvers.continuation import DisplacementControl as DisplacementControl
from truespring.solvers.cost import Cost as Cost
from truespring.solvers.newton import Newton as Newton
from truespring.solvers.solver import Coarse as Coarse
from truespring.solvers.solver import Geometry as Geometry
from truespring.solvers.solver import Solver as Solver
from truespring.solvers.solver import as_solver as as_solver
