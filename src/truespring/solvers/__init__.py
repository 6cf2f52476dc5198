"""Solvers: how equilibrium is found. They see potentials and loadings only."""

from truespring.solvers.newton import Equilibrium as Equilibrium
from truespring.solvers.newton import Newton as Newton
from truespring.solvers.newton import Reporter as Reporter
