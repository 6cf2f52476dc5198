"""Validity maps: up to which load, on which meshes, springs may be trusted."""

from truespring.validity.mapping import map_validity as map_validity
from truespring.validity.maps import Map as Map
from truespring.validity.maps import Validity as Validity
