"""The decks of CalculiX and Abaqus for solved springs, and what exported.json states of them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from truespring.errors import ExportError
from truespring.exports.continuum import check_fem, fem_element, fem_twin, usual_element
from truespring.exports.decks import Dialect, Twin, deck, described, levels_of
from truespring.exports.exported import Exported
from truespring.exports.features import Feature
from truespring.exports.split_law import split_state, stress_difference
from truespring.exports.spring_elements import SPRINGA, spring_twin
from truespring.exports.twins import explained, gaussian_twin, largest_modulus, one_volume, twin_types, volume_twin
from truespring.loading import vector_words
from truespring.models.spring_data import COUPLING, PRESSURE, VOLUME_TERM

#: Features of springs that the decks contain.
DECKS = SPRINGA | {Feature.VOLUME_TERM, Feature.COUPLING, Feature.PRESSURE, Feature.STIFFENING}
#: Names of the decks.
NAMES = ("springs.inp", "twin.inp", "fem.inp")

_STVK = "saint-venant-kirchhoff"
# Stretch at which headers state the difference of laws.
_STRETCH = 1.3


def deck_files(dialect: Dialect, exported: Exported) -> dict[str, str]:
    """Return `springs.inp` or `twin.inp`, and `fem.inp` if the problem has a continuum that the program supports."""
    name, file = _OF_SPRINGS[exported.springs.beyond](dialect, exported)
    return {name: file, **_fem(dialect, exported)}


def deck_values(dialect: Dialect, exported: Exported) -> Mapping[str, Any]:
    """Return what exported.json states of a twin: how it expresses the springs, and what to expect of it."""
    return {} if exported.springs.beyond not in _VALUES else _VALUES[exported.springs.beyond](dialect, exported)


def _fem(dialect: Dialect, exported: Exported) -> dict[str, str]:
    """Return fem.inp, nothing if the program does not support the continuum."""
    if _fem_fault(exported):
        return {}
    problem = exported.problem
    element = usual_element(problem)
    twin = fem_twin(problem, _STVK, dialect.force_unit, element)
    what = f"{dialect.program} {fem_element(problem, element)} elements, {dialect.nonlinear}"
    header = [*described(exported, what, springs=False), *_run(dialect, "fem"), *dialect.of_elements]
    return {"fem.inp": deck(dialect, twin, levels_of(exported), nonlinear=True, continuum=True, header=header)}


def _fem_fault(exported: Exported) -> str:
    """Return why there is no fem.inp; empty if there is one."""
    try:
        check_fem(exported.problem, _STVK)
    except ExportError as error:
        return f"fem.inp was not written: {error}."
    return ""


def _run(dialect: Dialect, name: str) -> Sequence[str]:
    return dialect.explained(name, dialect.force_unit)


def _file(dialect: Dialect, exported: Exported, what: str, twin: Twin, notes: Sequence[str], name: str) -> str:
    """Return the text of a deck of springs, or of their twin."""
    header = [*described(exported, f"{dialect.program} {what}", springs=True), *_run(dialect, name), *notes]
    fault = _fem_fault(exported)
    header += [fault] if fault else []
    continuum = "*ELSET, ELSET=BODY" in twin.model
    return deck(dialect, twin, levels_of(exported), nonlinear=True, continuum=continuum, header=header)


def _plain(dialect: Dialect, exported: Exported) -> tuple[str, str]:
    twin = spring_twin(exported.problem, exported.network, dialect.force_unit)
    notes = ["SPRINGA elements do not support loads that follow a face."]
    return "springs.inp", _file(dialect, exported, "SPRINGA elements", twin, notes, "springs")


# --- springs with a volume term ------------------------------------------------------------------


def _with_volume(dialect: Dialect, exported: Exported) -> tuple[str, str]:
    own = replace(dialect, force_unit=dialect.twin_unit(float(np.abs(exported.springs.arrays["kappa"]).max())))
    twin = volume_twin(own, exported)
    return "springs.inp", _file(own, exported, "SPRINGA elements", twin, dialect.solids.of_volume, "springs")


def _volume_values(dialect: Dialect, exported: Exported) -> dict[str, Any]:
    return {"expressed": " ".join(("Springs are SPRINGA elements.", *dialect.solids.of_volume))}


# --- Gaussian springs ----------------------------------------------------------------------------


def _hyperelastic(dialect: Dialect, exported: Exported) -> tuple[str, str]:
    own = replace(dialect, force_unit=dialect.twin_unit(largest_modulus(exported.problem)))
    notes = [_SMALL, *explained(own, exported), *_law_words(exported), *_full_load(exported)]
    what = f"{' and '.join(twin_types(own, exported))} elements, *HYPERELASTIC"
    return "twin.inp", _file(own, exported, what, gaussian_twin(own, exported), notes, "twin")


_SMALL = "TWIN at small strain only: the expected displacement is that of the springs, which it reaches at small loads."


def _law_words(exported: Exported) -> Iterator[str]:
    """Yield sentences on the law of the program."""
    yield (
        "*HYPERELASTIC, NEO HOOKE splits off the volume, C10 (I1 J^(-2/3) - 3) + (J - 1)^2 / D1; at small strain it is "
        "the law of the springs, mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2, with C10 = mu/2 and D1 = 2 / (lam + 2/3 mu)."
    )
    for material in exported.problem.materials:
        share = stress_difference(*material.lame, _STRETCH)
        yield (
            f"At Poisson's ratio {material.poisson:g} the stress of a bar stretched to {_STRETCH:g} times its length "
            f"is {abs(share):.1%} {'below' if share < 0 else 'above'} that of the neo-Hookean law."
        )
    law = exported.springs.arrays["law"]
    if law != "neo-hookean":
        yield f"The springs have the law {law}, which has no place in this deck."


def _full_load(exported: Exported) -> Iterator[str]:
    """Yield what to expect at full load."""
    found = _difference(exported)
    if found is None:
        yield "What to expect of the twin at full load is not known: truespring did not get there with its law."
    else:
        moved, share = found
        yield (
            f"With the law and elements of this deck node {exported.probe} moves at full load by "
            f"{vector_words(np.array(moved), 9)} m; the largest difference of a node is {share:.2%} of the largest "
            "displacement."
        )


def _difference(exported: Exported) -> tuple[list[float], float] | None:
    """Return the displacement of the probe with the law of the twin [m], and the largest difference of a node.

    The difference is from the displacement of the springs, over the largest displacement; None if unknown.
    """
    state = exported.state
    at_points = not one_volume(exported.problem)
    other = None if state is None else split_state(exported.path, exported.load_steps, at_points)
    if state is None or other is None:
        return None
    away = np.linalg.norm(other.displacement - state.displacement, axis=1).max()
    largest = np.linalg.norm(state.displacement, axis=1).max()
    return other.displacement[exported.probe].tolist(), float(away / largest)


def _gaussian_values(dialect: Dialect, exported: Exported) -> dict[str, Any]:
    found = _difference(exported)
    sentences = (*explained(dialect, exported), *_law_words(exported))
    return {
        "expressed": " ".join((_SMALL, *sentences)),
        "twin": {
            "file": "twin.inp",
            "small_strain_only": True,
            "stress_difference": {
                "stretch": _STRETCH,
                "of_materials": [stress_difference(*one.lame, _STRETCH) for one in exported.problem.materials],
            },
            "probe_displacement": None if found is None else found[0],
            "largest_difference": None if found is None else found[1],
        },
    }


# --- biquadratic springs -------------------------------------------------------------------------


def _elastic(dialect: Dialect, exported: Exported) -> tuple[str, str]:
    twin = fem_twin(exported.problem, _STVK, dialect.force_unit, "linear")
    header = [
        *described(exported, f"{dialect.program} {fem_element(exported.problem)} elements, *ELASTIC", springs=True),
        *_run(dialect, "twin"),
        *dialect.of_elastic,
    ]
    return "twin.inp", deck(dialect, twin, levels_of(exported), nonlinear=True, continuum=True, header=header)


def _elastic_values(dialect: Dialect, exported: Exported) -> dict[str, Any]:
    return {"expressed": " ".join(dialect.of_elastic)}


_OF_SPRINGS: Mapping[str, Callable[[Dialect, Exported], tuple[str, str]]] = MappingProxyType(
    {"": _plain, VOLUME_TERM: _with_volume, PRESSURE: _hyperelastic, COUPLING: _elastic}
)
_VALUES: Mapping[str, Callable[[Dialect, Exported], Mapping[str, Any]]] = MappingProxyType(
    {VOLUME_TERM: _volume_values, PRESSURE: _gaussian_values, COUPLING: _elastic_values}
)
