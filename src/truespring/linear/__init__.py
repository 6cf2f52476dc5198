"""Linear solvers: solve with a tangent stiffness and determine its stability, from matrices and nodes only."""

from truespring.linear.choice import LinearSolver as LinearSolver
from truespring.linear.choice import Tangent as Tangent
from truespring.linear.choice import check_linear as check_linear
from truespring.linear.choice import choose as choose
from truespring.linear.choice import processes_of as processes_of
