"""Rotated loads and motions on the same body, as a load case to hold out."""

from dataclasses import replace

import numpy as np

from truespring.problem import Problem


def turned(problem: Problem, angle: float = np.pi / 4) -> Problem | None:
    """Return the problem with dead loads and prescribed displacements rotated by an angle [rad].

    All are rotated in the plane of a plane body, in 3D about the coordinate axis along which they are smallest.
    Following loads, rotations and motions in some directions only are unchanged. None if nothing can be rotated.
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
