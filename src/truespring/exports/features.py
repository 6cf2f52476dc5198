"""Features of springs and loads that some targets do not support, and the error for these."""

from collections.abc import Collection, Iterator
from enum import StrEnum

import numpy as np

from truespring.errors import ExportError
from truespring.models import LAWS, stiff_fibres
from truespring.models.pair_laws import STRAIGHT
from truespring.models.spring_data import COUPLING, PRESSURE, VOLUME_TERM, SpringData
from truespring.problem import Problem

# Relative difference of rest length and distance of the nodes that counts as rounding.
_AT_REST = 1e-12


class Feature(StrEnum):
    """A feature beyond linear springs of positive stiffness, at rest in the undeformed body, under dead loads."""

    VOLUME_TERM = VOLUME_TERM
    COUPLING = COUPLING
    PRESSURE = PRESSURE
    STIFFENING = "law of Gaussian springs that stiffen"
    FIBRES = "fibres of Gaussian springs"
    NEGATIVE = "negative stiffness"
    PRESTRESS = "prestress"
    FORCE_LAW = "force law"
    FOLLOWING = "load that follows the body"


#: All features.
ALL = frozenset(Feature)


def features(problem: Problem, springs: SpringData) -> Iterator[tuple[Feature, str]]:
    """Yield the features of springs and loads, each with where it occurs and how to avoid it."""
    if springs.beyond == VOLUME_TERM:
        yield Feature.VOLUME_TERM, "use a model without volume = true"
    if springs.beyond == COUPLING:
        yield (
            Feature.COUPLING,
            "the springs of an element depend on each other's lengths, as those of the rule biquadratic do: use "
            "another rule",
        )
    if springs.beyond == PRESSURE:
        yield (
            Feature.PRESSURE,
            "springs of zero rest length, as those of the rule gaussian, are kept apart by a pressure in each element: "
            "use npz or json, or a rule of straight springs such as isotropic",
        )
        yield from _of_gaussian(springs)
    network = springs.network
    if network is not None:
        below = np.flatnonzero(network.stiffness < 0)
        if below.size:
            yield (
                Feature.NEGATIVE,
                f"{below.size} springs have one; the first is spring {below[0]} with {network.stiffness[below[0]]:g} "
                "N/m: use another rule, or elements closer to squares and cubes",
            )
        distance = np.linalg.norm(np.diff(network.nodes[network.springs], axis=1)[:, 0], axis=1)
        tensed = np.flatnonzero(np.abs(distance - network.rest_length) > _AT_REST * distance)
        if tensed.size:
            first = int(tensed[0])
            yield (
                Feature.PRESTRESS,
                f"the rest lengths of {tensed.size} springs differ from the distances of their nodes; the first is "
                f"spring {first} with {network.rest_length[first]:g} m instead of {distance[first]:g} m: use springs "
                "without prestress",
            )
        if not network.pair_law.linear:
            yield (
                Feature.FORCE_LAW,
                f"law = '{network.law}' is a force law other than k (l - L): use law = '{STRAIGHT}'",
            )
    for load in problem.loads:
        if load.follows:
            yield Feature.FOLLOWING, f"{load.words()} follows the body: use {load.instead}, or finite elements instead"


def _of_gaussian(springs: SpringData) -> Iterator[tuple[Feature, str]]:
    """Yield the features of Gaussian springs beyond springs of constant stiffness."""
    law = springs.arrays["law"]
    if not LAWS[law].constant_springs:
        yield Feature.STIFFENING, f"law = '{law}' changes the stiffness of all springs of an element: use neo-hookean"
    if any(name == "k1" or name.startswith("k1_") for name in springs.arrays):
        yield Feature.FIBRES, "the material has fibres: remove them, or set their k1 to 0"


def refuse_others(problem: Problem, springs: SpringData, takes: Collection[Feature], program: str) -> None:
    """Raise UntakenError for the first feature of springs or loads that is not in `takes`.

    Raises ExportError for fibres, and for what `refuse_unwritten` does.
    """
    refuse_unwritten(problem, program)
    if springs.beyond != PRESSURE:  # the arrays of these contain the fibres
        refuse_fibres(problem, program)
    for feature, where in features(problem, springs):
        if feature not in takes:
            raise UntakenError(feature, f"{program} does not support {feature}: {where}")


def refuse_unwritten(problem: Problem, program: str) -> None:
    """Raise ExportError for what no target has: a motion, load histories, tools and grasps."""
    for what in _unwritten(problem):
        raise ExportError(f"{program}: {what}")


def _unwritten(problem: Problem) -> Iterator[str]:
    """Yield what no target has, and what to do instead."""
    if problem.dynamics is not None:
        yield (
            "a motion is not exported, only an equilibrium: leave [dynamics] out, or use models that truespring solves"
        )
    loads = [(load.over, load.words()) for load in problem.loads]
    supports = [(support.over, support.words(problem.mesh.dim)) for support in problem.supports]
    for over, words in (*loads, *supports):
        if over is not None:
            yield (
                f"the history of {words} is not exported, only loads in proportion to the load factor: leave over "
                "out, or use models that truespring solves"
            )
    for one in problem.touching:
        yield f"tools and grasps, such as '{one.name}', are not exported: use models that truespring solves"


def refuse_fibres(problem: Problem, program: str) -> None:
    """Raise ExportError if the material has fibres with a stiffness."""
    if stiff_fibres(problem) is not None:
        raise ExportError(
            f"{program}: the fibres of the material are not exported: solve it here, or remove the fibres or set their "
            "k1 to 0"
        )


class UntakenError(ExportError):
    """A feature of springs or loads that a program does not support."""

    def __init__(self, feature: Feature, message: str) -> None:
        """Set `feature` and the message."""
        super().__init__(message)
        self.feature = feature
