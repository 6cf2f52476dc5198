"""A stiffness rule: the same stiffness for all springs of an element, E times the square root of its area."""

import numpy as np

from truespring.models.rules import LatticeModuli, Rule
from truespring.problem import Problem


def uniform(problem: Problem) -> np.ndarray:
    """Return E t / 2 for each link [N/m], shape (n_elements, links): one stiffness for edges and diagonals."""
    assert problem.section is not None
    young = problem.of_elements(lambda material: material.young)
    links = len(problem.mesh.kind.links)
    return np.repeat(young[:, None] * problem.section.thickness / 2, links, axis=1)


UNIFORM = Rule(
    uniform,
    ("quadrilateral",),
    "one stiffness, E t / 2, for all springs",
    (LatticeModuli("squares", (4 / 3, 4 / 3), (1 / 3, 1 / 3)),),
    "an example",
    shapes={"quadrilateral": "square"},
)
