"""Geometry that knows no physics: nodes, elements, named sides, selections."""

from truespring.mesh.files import read_mesh as read_mesh
from truespring.mesh.kinds import ELEMENT_KINDS as ELEMENT_KINDS
from truespring.mesh.kinds import ElementKind as ElementKind
from truespring.mesh.mesh import Mesh as Mesh
from truespring.mesh.selections import Box as Box
from truespring.mesh.selections import Near as Near
from truespring.mesh.selections import Plane as Plane
from truespring.mesh.selections import Selection as Selection
from truespring.mesh.selections import covering as covering
from truespring.mesh.selections import named_point as named_point
from truespring.mesh.selections import nearest_node as nearest_node
from truespring.mesh.selections import select as select
from truespring.mesh.selections import select_elements as select_elements
from truespring.mesh.selections import shares as shares
from truespring.mesh.shapes import DIAGONALS as DIAGONALS
from truespring.mesh.shapes import PLANE_ELEMENTS as PLANE_ELEMENTS
from truespring.mesh.shapes import SOLID_ELEMENTS as SOLID_ELEMENTS
from truespring.mesh.shapes import box as box
from truespring.mesh.shapes import rectangle as rectangle
from truespring.mesh.shapes import refuse_too_large as refuse_too_large
from truespring.mesh.surface import Surface as Surface
from truespring.mesh.surface import SurfaceDistance as SurfaceDistance
from truespring.mesh.surface import surface_distance as surface_distance
