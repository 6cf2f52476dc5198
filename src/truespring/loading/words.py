"""Descriptions of vectors and selections for file headers, tables and error messages."""

from collections.abc import Sequence

from truespring.arrays import Floats
from truespring.mesh import Box, Near, Plane, Selection, counted


def vector_words(values: Sequence[float] | Floats, digits: int = 6) -> str:
    """Return the components of a vector as text: "(0, -0.043)"."""
    return f"({', '.join(f'{value:.{digits}g}' for value in values)})"


def selection_words(on: Selection) -> str:
    """Return a description of a selection: "'right'", "the nodes at x = 0.16 m", "3 nodes"."""
    match on:
        case str():
            return f"'{on}'"
        case Plane(axis, value):
            return f"the nodes at {axis} = {value:g} m"
        case Box(lower, upper):
            return f"the nodes from {vector_words(lower)} to {vector_words(upper)} m"
        case Near(point):
            return f"the node nearest to {vector_words(point)} m"
        case _:
            return counted(len(on), "node")


def element_words(on: Selection) -> str:
    """Return a description of a selection of elements: "'muscle'", "3 elements"."""
    match on:
        case str():
            return f"'{on}'"
        case Box(lower, upper):
            return f"the elements with centres from {vector_words(lower)} to {vector_words(upper)} m"
        case Plane() | Near():
            return selection_words(on)
        case _:
            return counted(len(on), "element")
