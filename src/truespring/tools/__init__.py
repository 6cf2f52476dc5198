"""Tools that touch a body, and grasps that hold a patch of it by springs."""

from truespring.tools.grasp import Grasp as Grasp
from truespring.tools.table import TOOLS as TOOLS
from truespring.tools.tool import Tool as Tool
