"""A stiffness rule: the same stiffness for all springs of an element, E times the square root of its area."""

import numpy as np

from truespring.errors import ModelError
from truespring.models import RULES
from truespring.models.rules import LatticeModuli, Rule
from truespring.problem import Problem


def uniform(problem: Problem) -> np.ndarray:
    """Return E t / 2 for each link [N/m], shape (n_elements, links): one stiffness for edges and diagonals.

    Raises ModelError for elements that are no squares.
    """
    mesh = problem.mesh
    links = np.array(mesh.kind.links)
    ends = mesh.nodes[mesh.elements[:, links]]
    lengths = np.sort(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2), axis=1)
    if np.abs(lengths / lengths[:, :1] - np.sqrt([1, 1, 1, 1, 2, 2])).max() > 1e-6:
        others = [name for name, rule in RULES.items() if rule.takes(mesh) and not rule.shapes]
        raise ModelError(f"rule = 'uniform' requires squares: use one of the rules {', '.join(others)}")
    assert problem.section is not None
    young = problem.of_elements(lambda material: material.young)
    return np.repeat(young[:, None] * problem.section.thickness / 2, len(links), axis=1)


UNIFORM = Rule(
    uniform,
    ("quadrilateral",),
    "one stiffness, E t / 2, for all springs",
    (LatticeModuli("squares", (4 / 3, 4 / 3), (1 / 3, 1 / 3)),),
    "an example",
    shapes={"quadrilateral": "square"},
)
