"""Springs as SPRINGA elements of keyword decks, for CalculiX and Abaqus."""

from collections.abc import Iterator

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Loading
from truespring.exports.decks import Twin, joined, real
from truespring.exports.features import Feature, refuse_others
from truespring.models.spring_data import PlainSprings
from truespring.problem import Problem

#: Features that SPRINGA elements support. Rest lengths other than the distance of the nodes are a table of forces.
SPRINGA = frozenset({Feature.NEGATIVE, Feature.PRESTRESS})

# Largest length in the table of a prestressed spring, over the distance of its nodes.
_LONGEST = 100.0
# Relative difference of rest length and distance of the nodes that counts as rounding.
_AT_REST = 1e-12
# Offset of unsupported nodes, as a share of their longest spring; stiffness below which a direction is unsupported, as
# a share of the largest.
_ASIDE, _LOOSE = 1e-2, 1e-9


def spring_twin(problem: Problem, network: PlainSprings, force_unit: float) -> Twin:
    """Return the springs as SPRINGA elements, one element set for each stiffness.

    Raises ExportError for features that are not in SPRINGA.
    """
    refuse_others(problem, network.spring_data(), SPRINGA, "a SPRINGA element")
    members: dict[tuple[str, ...], list[int]] = {}
    for number, known in enumerate(_laws(network, force_unit)):
        members.setdefault(known, []).append(number)
    lines: list[str] = []
    for group, (law, numbers) in enumerate(members.items(), 1):
        lines.append(f"*ELEMENT, TYPE=SPRINGA, ELSET=S{group}")
        lines += (f"{number + 1}, {joined((network.springs[number] + 1).tolist())}" for number in numbers)
        table = ", NONLINEAR" if len(law) > 1 else ""
        lines += [f"*SPRING, ELSET=S{group}{table}", "", *law]  # the blank line is for directions
    plane = ["NALL, 3, 3"] if network.nodes.shape[1] == 2 else []  # SPRINGA acts in 3D: hold z
    lines += ["*BOUNDARY", *plane] if plane else []
    aside = _aside(network, problem.loading)
    return Twin(network.nodes, lines, problem.loading, aside=aside, for_good=plane)


def _laws(network: PlainSprings, force_unit: float) -> Iterator[tuple[str, ...]]:
    """Yield the lines of data of each spring: its stiffness, or if it is prestressed two pairs of force and elongation.

    The program counts the elongation from the distance of the nodes; outside a table the force is constant.
    """
    distance = np.linalg.norm(np.diff(network.nodes[network.springs], axis=1)[:, 0], axis=1)
    values = (network.stiffness / force_unit, network.rest_length, distance)
    for stiffness, rest, length in zip(*(value.tolist() for value in values), strict=True):
        if abs(length - rest) <= _AT_REST * length:
            yield (real(stiffness),)
        else:
            ends = (0.0, _LONGEST * length)
            yield tuple(f"{real(stiffness * (end - rest))}, {real(end - length)}" for end in ends)


def is_led_aside(problem: Problem, network: PlainSprings) -> bool:
    """Return whether a deck of springs needs a step that displaces unsupported nodes before the first level."""
    return bool(_aside(network, problem.loading).any())


def _aside(network: PlainSprings, loading: Loading) -> Floats:
    """Return the offset of nodes with a free direction in which no spring acts at rest [m], shape (n_nodes, dim).

    The springs stiffen as the node moves, but Newton's method without line search cannot start at zero stiffness.
    """
    n_nodes, dim = network.nodes.shape
    ends = network.springs
    along = np.diff(network.nodes[ends], axis=1)[:, 0]
    length = np.linalg.norm(along, axis=1)
    along /= length[:, None]
    stiffness, reach = np.zeros((n_nodes, dim, dim)), np.zeros(n_nodes)
    for end in ends.T:
        np.add.at(stiffness, end, network.stiffness[:, None, None] * along[:, :, None] * along[:, None, :])
        np.maximum.at(reach, end, length)
    largest = float(np.abs(stiffness).max())
    free = ~loading.held
    stiffness = stiffness * free[:, :, None] * free[:, None, :] + largest * np.eye(dim) * loading.held[:, None, :]
    values, vectors = np.linalg.eigh(stiffness)
    loose = np.abs(values) <= _LOOSE * largest
    ways = np.where(loose[:, None, :], vectors, 0.0)  # as columns
    pulled = np.einsum("nai,nbi,nb->na", ways, ways, loading.external_force)
    size = np.linalg.norm(pulled, axis=1)
    idle = loose.any(axis=1) & (size == 0)
    pulled[idle] = ways[idle, :, :].sum(axis=2)
    size = np.linalg.norm(pulled, axis=1)
    share = np.divide(_ASIDE * reach, size, out=np.zeros(n_nodes), where=size > 0)
    return np.asarray(share[:, None] * pulled)
