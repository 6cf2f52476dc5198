"""Small bodies of several kinds of elements."""

import numpy as np

import truespring as ts
from truespring.arrays import Floats, Ints

#: The faces of a hexahedron, seen from inside anticlockwise: bases of the pyramids that divide it.
_FACES = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))


def halves(bricks: Ints) -> Ints:
    """Two wedges a brick, their triangles across z."""
    return np.concatenate([bricks[:, [0, 1, 2, 4, 5, 6]], bricks[:, [0, 2, 3, 4, 6, 7]]])


def plane_of_two(size: tuple[float, float], elements: tuple[int, int]) -> ts.Mesh:
    """A rectangle of quadrilaterals, those of the right third halved into triangles."""
    whole = ts.rectangle(size, elements)
    right = whole.centres[:, 0] > 2 / 3 * size[0]
    triangles = whole.elements[right][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return ts.Mesh.of_kinds(whole.nodes, {"quadrilateral": whole.elements[~right], "triangle": triangles})


def solid_of_four(width: float = 1.0) -> ts.Mesh:
    """Three cubes in a row, of a width: a hexahedron, two wedges, and five pyramids with two tetrahedra at the end."""
    bricks = ts.box((3 * width, width, width), (3, 1, 1))
    first, second, third = bricks.elements
    tip = bricks.n_nodes
    nodes: Floats = np.concatenate([bricks.nodes, bricks.centres[2:]])
    end = third[list(_FACES[3])]
    return ts.Mesh.of_kinds(
        nodes,
        {
            "hexahedron": first[None],
            "wedge": halves(second[None]),
            "pyramid": np.array([[*third[list(face)], tip] for face in _FACES if face != _FACES[3]]),
            "tetrahedron": np.array([[*end[[0, 1, 2]], tip], [*end[[0, 2, 3]], tip]]),
        },
    )


def shaken(mesh: ts.Mesh, share: float, seed: int = 5) -> ts.Mesh:
    """The mesh with its nodes moved by up to a length [m]."""
    moved = np.random.default_rng(seed).uniform(-share, share, mesh.nodes.shape)
    return ts.Mesh(mesh.nodes + moved, mesh.elements, mesh.element)


def random_mesh(element: str, generator: np.random.Generator) -> ts.Mesh:
    """A few elements of random shape, turned anyhow and of any size."""
    match element:
        case "triangle":
            mesh = ts.rectangle((2.0, 1.0), (2, 1), "triangle", "alternating")
        case "quadrilateral":
            mesh = ts.rectangle((2.0, 1.0), (2, 1))
        case "tetrahedron":
            mesh = ts.box((1.0, 1.0, 1.0), (1, 1, 1), "tetrahedron")
        case _:
            mesh = ts.box((2.0, 1.0, 1.0), (2, 1, 1), element)
    jitter = 0.12 if element in ("tetrahedron", "pyramid") else 0.17
    shaken = mesh.nodes * generator.uniform(0.6, 1.6, mesh.dim) + generator.uniform(-jitter, jitter, mesh.nodes.shape)
    turn = np.linalg.qr(generator.normal(size=(mesh.dim, mesh.dim)))[0]
    turn[0] *= np.sign(np.linalg.det(turn))
    return ts.Mesh(shaken @ turn.T * 10 ** generator.uniform(-2, 2), mesh.elements, element)
