"""Tools that touch a body, and grasps that hold a patch of it by springs."""

from truespring.tools.grasp import Grasp as Grasp
from truespring.tools.laws import CONTACTS as CONTACTS
from truespring.tools.path import Path as Path
from truespring.tools.path import varies as varies
from truespring.tools.shapes import Block as Block
from truespring.tools.shapes import Capsule as Capsule
from truespring.tools.shapes import HalfSpace as HalfSpace
from truespring.tools.shapes import Sphere as Sphere
from truespring.tools.skins import Skin as Skin
from truespring.tools.stl import StlTool as StlTool
from truespring.tools.table import TOOLS as TOOLS
from truespring.tools.tool import Tool as Tool
