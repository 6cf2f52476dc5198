"""truespring: mass-spring bodies true to their material, beside FEM.

problem  x  model  x  solver  ->  path of equilibria  ->  comparison  ->  report
"""

from truespring.compare import Comparison as Comparison
from truespring.compare import compare as compare
from truespring.equilibrium import Path as Path
from truespring.equilibrium import State as State
from truespring.equilibrium import Status as Status
from truespring.equilibrium import solve as solve
from truespring.errors import TruespringError as TruespringError
from truespring.material import Material as Material
from truespring.material import PlaneStrain as PlaneStrain
from truespring.material import PlaneStress as PlaneStress
from truespring.mesh import Box as Box
from truespring.mesh import Mesh as Mesh
from truespring.mesh import Near as Near
from truespring.mesh import Plane as Plane
from truespring.mesh import named_point as named_point
from truespring.mesh import nearest_node as nearest_node
from truespring.mesh import rectangle as rectangle
from truespring.models import LAWS as LAWS
from truespring.models import RULES as RULES
from truespring.models import Fem as Fem
from truespring.models import Moduli as Moduli
from truespring.models import SpringNetwork as SpringNetwork
from truespring.models import Springs as Springs
from truespring.models import UserStiffness as UserStiffness
from truespring.models import moduli as moduli
from truespring.problem import Fixed as Fixed
from truespring.problem import Force as Force
from truespring.problem import Problem as Problem
from truespring.solvers import Newton as Newton

__all__ = [
    "LAWS",
    "RULES",
    "Box",
    "Comparison",
    "Fem",
    "Fixed",
    "Force",
    "Material",
    "Mesh",
    "Moduli",
    "Near",
    "Newton",
    "Path",
    "Plane",
    "PlaneStrain",
    "PlaneStress",
    "Problem",
    "SpringNetwork",
    "Springs",
    "State",
    "Status",
    "TruespringError",
    "UserStiffness",
    "compare",
    "moduli",
    "named_point",
    "nearest_node",
    "rectangle",
    "solve",
]
