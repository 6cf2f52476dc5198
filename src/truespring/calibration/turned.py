"""A problem's loads and motions turned: other loads on the same body, to hold out."""

from dataclasses import replace

import numpy as np

from truespring.problem import Problem


def turned(problem: Problem, angle: float = np.pi / 4) -> Problem | None:
    """Return the problem with its dead loads and prescribed displacements turned by an angle [rad].

    All turn about one axis: in the plane of the body, or in space about the coordinate axis along which they are
    smallest. Loads that follow the body, rotations, and motions of some directions only stay as they are. None where
    nothing turns.
    """
    ours = [one.vector for one in problem.loads] + [one.vector for one in problem.supports]
    vectors = [vector for vector in ours if vector is not None and vector.any()]
    if not vectors:
        return None
    dim = problem.mesh.dim
    sizes = np.array(vectors)
    axis = 2 if dim == 2 else int(np.abs(sizes / np.linalg.norm(sizes, axis=1, keepdims=True)).sum(axis=0).argmin())
    turn = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn[first, first] = turn[second, second] = np.cos(angle)
    turn[second, first], turn[first, second] = np.sin(angle), -np.sin(angle)
    return replace(
        problem,
        supports=[one.turned(turn[:dim, :dim]) for one in problem.supports],
        loads=[one.turned(turn[:dim, :dim]) for one in problem.loads],
    )
