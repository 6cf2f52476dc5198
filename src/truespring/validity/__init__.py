"""Validity maps: up to which load, and on which meshes, springs agree with FEM."""

from truespring.validity.axes import read_range as read_range
from truespring.validity.loads import LOAD_TYPES as LOAD_TYPES
from truespring.validity.mapping import map_validity as map_validity
from truespring.validity.maps import Map as Map
from truespring.validity.result import Validity as Validity
from truespring.validity.writing import validity_values as validity_values
from truespring.validity.writing import write_validity as write_validity
