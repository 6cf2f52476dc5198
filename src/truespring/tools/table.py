"""The shapes of tools in study files."""

from collections.abc import Mapping
from types import MappingProxyType

from truespring.tools.shapes import Block, Capsule, HalfSpace, Sphere
from truespring.tools.stl import StlTool
from truespring.tools.tool import Tool

#: The classes of tools by the value of the key `shape` of `[[tool]]`.
TOOLS: Mapping[str, type[Tool]] = MappingProxyType(
    {"sphere": Sphere, "capsule": Capsule, "plane": HalfSpace, "box": Block, "stl": StlTool}
)
