"""The verdict: how far a model may be trusted, in plain sentences made from numbers alone."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.comparison import Comparison
from truespring.equilibrium import Solution, State, Status
from truespring.mesh.selections import AXES
from truespring.models import Fem, moduli_findings
from truespring.reactions import SupportForce, leading_support, moved_supports
from truespring.report.quantity import percent, quantity, tolerance_percent
from truespring.report.result import Result
from truespring.report.standing import equally_wrong_sentence, own_error_sentence
from truespring.support_errors import SupportError, decisive


def verdict(result: Result) -> str:
    """Return the verdict as one text."""
    return " ".join(verdict_sentences(result))


def verdict_sentences(result: Result) -> tuple[str, ...]:
    """Return what a reader must know first: trouble of the model itself, then where it agrees with what."""
    return tuple(_capital(sentence) for sentence in (*_trouble(result), *_agreement(result)))


def closest_sentence(result: Result) -> str | None:
    """Return which reference is nearest at full load; None where none is to be named."""
    name = nearest_reference(result)
    if name is None:
        return None
    error = result.comparisons[name].rms_error
    assert error is not None  # what Result.closest chooses by
    what = " in displacement" if result.comparisons[name].force_error is not None else ""
    return f"Nearest{what} at {_full(result)} is {display_name(result, name)}, {percent(error)} off."


def cause_sentence(result: Result) -> str | None:
    """Return whether the distance to the nearest nonlinear FEM comes with the load or is there from the start.

    What is there at the first level is stiffness: moduli, bending, elements. What comes later is how springs
    and law answer to large strain. None where there is no such FEM, or it is the springs but for rounding.
    """
    nonlinear = {
        name: one
        for name, one in result.comparisons.items()
        if one.reference.element is not None
        and one.reference.finite
        and one.load_factors.size > 1
        and one.rms_errors[-1] > _TOLD_APART
    }
    if not nonlinear or result.model is None or not result.paths[result.model].has_springs:
        return None
    name = min(nonlinear, key=lambda one: float(nonlinear[one].rms_errors[-1]))
    levels, errors = nonlinear[name].load_factors, nonlinear[name].rms_errors
    first, last = percent(float(errors[0])), percent(float(errors[-1]))
    what = (
        f"The distance to {display_name(result, name)} is {first} at load factor {levels[0]:.4g} and {last} at the last"
    )
    if errors[-1] > 2 * errors[0]:
        return f"{what}: most of it comes with large strain, to which springs and law answer differently."
    if errors[0] > 2 * errors[-1]:
        return f"{what}: the springs' stiffness is off from the start, and large strain hides it."
    return f"{what}: most of it is there from the start, in the springs' moduli and bending stiffness on this mesh."


# Below this rms error there is nothing to explain.
_TOLD_APART = 0.005


def nearest_reference(result: Result) -> str | None:
    """Return the name of the nearest reference; None without a choice, or where the model itself is in trouble."""
    if result.model is None or len(result.comparisons) < 2 or path_trouble(result, result.model):
        return None
    return result.closest


def reach(result: Result, one: Comparison) -> str:
    """Return where the model is within the tolerance of a reference: a phrase to follow its name."""
    levels, runs = one.load_factors, _runs(one)
    if not runs:
        return _NEVER
    if one.agrees_up_to_load_factor is None:
        return f"at {level_name(result, levels[0])}, the only level it is known at"
    first, *more = runs
    if first[0] == levels[0]:
        last = ", the last level that both reached" if first[1] == levels[-1] != 1 else ""
        again = f" and again {_listed([_span(result, run, levels[-1]) for run in more])}" if more else ""
        return f"up to {level_name(result, first[1])}{last}{again}"
    return f"only {_listed([_span(result, run, levels[-1]) for run in runs])}"


def force_sentence(result: Result) -> str | None:
    """Return what each moved support takes in each model, force and torque; None where none moves or is known.

    Along the support's own motion: a force is positive along its displacement, a torque about the axis of its turn,
    and negative where the body has to be held back.
    """
    if result.model is None or not result.paths[result.model].states:
        return None
    model = result.paths[result.model]
    level = model.load_factor
    found = [
        sentence
        for one in (model.support_forces(model.states[-1]) if level else ())
        for sentence in _taken(result, level, one)
    ]
    return " ".join(found) or None


def _taken(result: Result, level: float, own: SupportForce) -> Iterator[str]:
    """What a support takes along its displacement and about the axis of its turn, a sentence each."""
    problem = result.problem
    if not problem.stated or result.model is None:
        return
    held = problem.held[own.support]
    several = len(moved_supports(problem)) > 1
    ways: list[tuple[str, Floats, str, str]] = []
    if held.motion.any():
        ways.append(("force", held.motion / np.linalg.norm(held.motion), "N", f", along {_axis_name(held.motion)}"))
    if held.turn is not None:
        axis = held.turn.axis if problem.mesh.dim == 3 else np.ones(1)
        ways.append(("torque", axis * np.sign(held.turn.angle), "N m", ", along its turn"))
    for what, way, unit, along in ways:

        def told(one: SupportForce, what: str = what, way: Floats = way, unit: str = unit) -> str:
            return quantity(float((one.force if what == "force" else one.torque) @ way), unit)

        to_move = f" to move {own.name}" if several else ""
        parts = [
            f"The {what} it takes{to_move} at {level_name(result, level)}{along}: {_subject(result)[0]} {told(own)}"
        ]
        for name, one in result.comparisons.items():
            error = next((e for pairs in _at(one, level) for e in pairs if e.mine.support == own.support), None)
            if error is not None:
                off = error.force_error if what == "force" else error.torque_error
                apart = "" if off is None else f" ({percent(off)} off)"
                parts.append(f"{display_name(result, name)} {told(error.theirs)}{apart}")
        yield ", ".join(parts) + "."


def _at(one: Comparison, level: float) -> list[tuple[SupportError, ...]]:
    """The errors of supports at a level, none where it is not compared."""
    return [one.support_errors[place] for place in np.flatnonzero(one.load_factors == level)]


def _axis_name(vector: Floats) -> str:
    """A direction as people write it: x, −y; of several components the way itself."""
    if np.count_nonzero(vector) > 1:
        return "its way"
    axis = int(np.abs(vector).argmax())
    return Drive(axis, float(np.sign(vector[axis]))).name


def mesh_sentence(result: Result) -> str | None:
    """Return how far off the reference's own elements are in bending; None where that is little or not known.

    The springs' moduli hold it for the elements that are the default here and for bending along x, so it is
    said of bodies that are driven across x, along y.
    """
    known = next((path.moduli for path in result.paths.values() if path.moduli is not None), None)
    used = {one.reference.element for one in result.comparisons.values()}
    if known is None or known.depth is None or drive(result).axis != 1:
        return None
    if Fem("linear").chosen_element(result.problem) not in used:
        return None
    excess = known.fem_bending[known.depth] - 1
    if abs(excess) <= 0.01:
        return None
    stiff = "stiff" if excess > 0 else "soft"
    return (
        f"The {_ELEMENTS[result.problem.mesh.element]} themselves are {percent(abs(excess))} too {stiff} in "
        f"bending on this mesh ({deep(known.depth)}): a refined mesh tells how much of the distance is theirs."
    )


def carrying_sentence(result: Result) -> str | None:
    """Return at which nodes results were compared where two were; None of a study, whose models share their nodes."""
    if not result.in_detail or result.model is None:
        return None
    ((name, one),) = result.comparisons.items()
    mesh = one.model.problem.mesh
    model, reference = display_name(result, result.model), display_name(result, name)
    if not one.model.states or not one.reference.states:
        alone = reference if not one.reference.states else model
        return f"{alone} tells a deformed surface only: what can be compared are surfaces."
    if one.node_by_node:
        return f"Both have the same {mesh.n_nodes:,} nodes and are compared node by node."
    at_reference = one.reference.problem is one.known_on[1].problem
    carried, to = (model, reference) if at_reference else (reference, model)
    left = f"; {one.n_outside:,} of them lie outside and are left out" if one.n_outside else ""
    return f"{carried} is carried to the {mesh.n_nodes:,} nodes of {to} by the interpolation of its own elements{left}."


def material_name(result: Result) -> str:
    """Return what the moduli that are wanted are called: in plane strain they are not the material's own."""
    return "material" + (result.problem.section.within if result.problem.section else "")


def linear_fem(path: Solution) -> str:
    """Return what finite elements of first order on the mesh of a path are called."""
    corners = {
        "quadrilateral": "four-node ",
        "hexahedron": "eight-node ",
        "wedge": "six-node ",
        "pyramid": "five-node ",
    }
    return f"linear {corners.get(path.problem.mesh.element, '')}FEM"


# What the elements of first order of each kind of mesh are called.
_ELEMENTS = {
    "quadrilateral": "four-node elements",
    "triangle": "linear triangles",
    "hexahedron": "eight-node elements",
    "tetrahedron": "linear tetrahedra",
}


def deep(depth: int) -> str:
    """Return a number of elements through the depth in words."""
    return f"{depth} element{'' if depth == 1 else 's'} deep"


def moduli_sentence(path: Solution) -> str | None:
    """Return the effective moduli of the springs of a path beside the material's; None where it has no moduli."""
    if path.moduli is None:
        return None
    said = [one.sentence for one in moduli_findings(path.problem, path.moduli)]
    regions = " This is for the body's own material, outside its regions." if path.problem.regions else ""
    return f"{'; '.join(said)}.{regions}"


def path_trouble(result: Result, name: str) -> str | None:
    """Return what went wrong with a path, None where it reached full load through stable equilibria."""
    path = result.paths[name]
    who, plural = _subject(result) if name == result.model else (display_name(result, name), False)
    match path.status:
        case Status.NOT_CONVERGED if path.load_factor == 0:
            return f"{who} found no equilibrium at any load level."
        case Status.NOT_CONVERGED:
            return f"{who} found no equilibrium beyond load factor {path.load_factor:.4g}."
        case Status.INVERTED:
            start = _first(path, lambda state: state.area_ratio <= 0)
            have = "have" if plural else "has"
            return f"{who} {have} an element turned inside out{start}; from there on the numbers say little."
        case Status.UNSTABLE:
            start = _first(path, lambda state: bool(state.negative_eigenvalues))
            are = "are" if plural else "is"
            return f"{who} {are} in an unstable equilibrium{start}; a real body would leave it."
        case _:
            return None


def display_name(result: Result, name: str) -> str:
    """Return the label of a path, with its name in the study where the label alone is not its own."""
    label = result.paths[name].label
    alone = sum(path.label == label for path in result.paths.values()) == 1
    return label if alone else f"{label} ({name})"


def level_name(result: Result, load_factor: float) -> str:
    """Return a load level in words: full load, full motion where nothing but supports drives, or its factor."""
    if load_factor == 1:
        return _full(result)
    return f"{load_factor:.4g} of the displacement" if _by_displacement(result) else f"load factor {load_factor:.4g}"


@dataclass(frozen=True, slots=True)
class Drive:
    """What moves a body most: the direction `axis` (0 is x), `sign` 1 or -1 along it."""

    axis: int
    sign: float

    def along(self, vector: Floats) -> float:
        """Return the component of a vector, positive along the drive."""
        return self.sign * float(vector[self.axis])

    @property
    def name(self) -> str:
        """The direction as people write it: x, −y."""
        return f"{'−' if self.sign < 0 else ''}{AXES[self.axis]}"


def drive(result: Result) -> Drive:
    """Return the dominant direction of the total force, or of the prescribed motion where no load is given.

    Where it is not known what acts, that in which the probe moves.
    """
    if not result.problem.stated:
        moved = next(
            (path.states[-1].displacement[result.probe] for path in result.paths.values() if path.states), None
        )
        if moved is None or not moved.any():
            return Drive(0, 1.0)
        axis = int(np.abs(moved).argmax())
        return Drive(axis, float(np.sign(moved[axis])))
    loading = result.problem.loading
    leading = leading_support(result.problem)
    if _driven_by_motion(result) and leading is not None:
        held = result.problem.held[leading]
        return _largest(held.motion[None] if held.motion.any() else loading.motion()[held.nodes])
    force = loading.force(result.problem.mesh.nodes)
    total = force.sum(axis=0)
    # Loads that balance each other have no total: the largest single one decides.
    return _largest(force if np.abs(total).max() <= 1e-9 * np.abs(force).max() else total[None])


def _largest(vectors: Floats) -> Drive:
    """The direction of the largest component of several vectors."""
    place = int(np.abs(vectors).argmax())
    return Drive(place % vectors.shape[1], float(np.sign(vectors.ravel()[place])))


# --- what the sentences are made of -------------------------------------------------------------


def _trouble(result: Result) -> Iterator[str]:
    """The model's own trouble first, then that of its references."""
    names = [result.model] if result.model is not None else []
    for name in names + [name for name in result.comparisons if name != result.model]:
        trouble = path_trouble(result, name)
        if trouble is not None:
            yield trouble


def _agreement(result: Result) -> Iterator[str]:
    if result.model is None or not result.comparisons:
        yield from _alone(result)
        return
    measured = {name: one for name, one in result.comparisons.items() if one.load_factors.size}
    if measured:
        where, beyond = _where_it_agrees(result, measured)
        errors = _errors(result, measured)
        if beyond and errors:
            yield f"{where}; beyond, {errors}."
        else:
            yield f"{where}."
            if errors:
                yield f"{errors}."
        who, plural = _subject(result)
        names = {name: display_name(result, name) for name in result.comparisons}
        yield from filter(None, (equally_wrong_sentence(result, who, plural, names), own_error_sentence(result, names)))
    for name, one in result.comparisons.items():
        if name not in measured or not _meets_at_full_load(one):
            yield _short_of_full_load(result, name, one)


def _alone(result: Result) -> Iterator[str]:
    if result.model is None:
        done = sum(path.status is Status.CONVERGED for path in result.paths.values())
        yield f"{done} of {len(result.paths)} models reached {_full(result)}; nothing was compared."
        return
    path = result.paths[result.model]
    who, plural = _subject(result)
    if path.status is Status.CONVERGED:
        verb = "reach" if plural else "reaches"
        yield f"{who} {verb} {_full(result)} through {_way(path)}; nothing was compared with them."
    else:
        yield "Nothing was compared."
    if path.states:
        moved = float(np.linalg.norm(path.states[-1].displacement[result.probe]))
        at = _full(result) if path.complete else level_name(result, path.load_factor)
        yield f"At {at} the probe has moved by {quantity(moved, 'm')}."


def _way(path: Solution) -> str:
    """What a path went through."""
    critical = [state for state in path.states if state.critical]
    if not critical:
        unstable = any(state.negative_eigenvalues for state in path.states)
        return "equilibria of which some are unstable" if unstable else "stable equilibria"
    kinds = {kind: [f"{one.load_factor:.4g}" for one in critical if one.critical == kind] for kind in _CRITICAL}
    told = [
        f"a {kind} at load factor {at[0]}" if len(at) == 1 else f"{kind}s at load factors {_listed(at)}"
        for kind, at in kinds.items()
        if at
    ]
    return f"{_listed(told)}, in part through unstable states"


_CRITICAL = ("limit point", "bifurcation")


def _where_it_agrees(result: Result, measured: dict[str, Comparison]) -> tuple[str, bool]:
    """Where the model is within the tolerance of which reference, and whether it agrees only up to a level."""
    who, plural = _subject(result)
    within = f"within {tolerance_percent(result.tolerance)} of"
    groups: dict[str, list[str]] = {}
    for name in sorted(measured, key=lambda name: _rank(measured[name])):
        groups.setdefault(reach(result, measured[name]), []).append(name)
    starts = any(_runs(one)[:1] and _runs(one)[0][0] == one.load_factors[0] for one in measured.values())
    verb = ("stay" if starts else "come") + ("" if plural else "s")
    if len(groups) > 1:
        clauses = [
            f"of {_listed([display_name(result, name) for name in names])} {where}" for where, names in groups.items()
        ]
        return f"{who} {verb} within {tolerance_percent(result.tolerance)} {_listed(clauses, ', and ')}", False
    ((where, names),) = groups.items()
    everyone = _everyone(result, names)
    if where == _NEVER:
        do = "do" if plural else "does"
        anyone = everyone if len(names) == 1 else "any reference"
        return f"at no load level {do} {who} come {within} {anyone}", False
    if where.startswith("up to"):
        comma = "," if "," in where else ""
        return f"{where}{comma} {who} {verb} {within} {everyone}", not where.startswith(f"up to {_full(result)}")
    return f"{who} {verb} {within} {everyone} {where}", False


_NEVER = "at no load level"


def _runs(one: Comparison) -> list[tuple[float, float]]:
    """First and last level of each stretch of neighbouring levels within the tolerance."""
    runs: list[tuple[float, float]] = []
    neighbour = False
    for level, error in zip(one.load_factors.tolist(), one.errors.tolist(), strict=True):
        if error < one.tolerance:
            runs[len(runs) - neighbour :] = [(runs[-1][0] if neighbour else level, level)]
        neighbour = error < one.tolerance
    return runs


def _span(result: Result, run: tuple[float, float], last: float) -> str:
    start, end = run
    if start == end:
        return f"at {level_name(result, start)}"
    if end == last:
        return f"from load factor {start:.4g} on"
    return f"between load factors {start:.4g} and {end:.4g}"


def _rank(one: Comparison) -> tuple[float, bool, float]:
    """Agreement that reaches farthest from zero first, none last, then the smaller error."""
    runs = _runs(one)
    from_zero = runs[0][1] if runs and runs[0][0] == one.load_factors[0] else 0.0
    return -from_zero, not runs, float(one.errors[-1])


def _errors(result: Result, measured: dict[str, Comparison]) -> str | None:
    """The errors at full load, smallest first; None where no reference meets the model there."""
    met = {name: one.error for name, one in measured.items() if one.error is not None}
    if not met:
        return None
    parts = [f"{display_name(result, name)} {_off(measured[name])}" for name in sorted(met, key=lambda name: met[name])]
    # Several errors of one reference have commas between them.
    between = "; " if any(np.isfinite(one.force_errors[-1]) for one in measured.values()) else ", "
    return f"at {_full(result)}: {between.join(parts)}"


def _off(one: Comparison) -> str:
    """How far the last level is off, the error that decides first; with forces, what each error is of."""
    displacement = float(one.rms_errors[-1])
    found = [(displacement, "in displacement")] if np.isfinite(displacement) else []
    several = len({error.mine.support for error in one.support_errors[-1]}) > 1
    largest = decisive(np.nan, one.support_errors[-1])
    if not largest.quantity:
        return percent(displacement)
    found.append((largest.error, f"in the {largest.quantity}{f' of {largest.support}' if several else ''}"))
    return ", ".join(f"{percent(error)} {what}" for error, what in sorted(found, reverse=True))


def _meets_at_full_load(one: Comparison) -> bool:
    return bool(one.load_factors.size) and float(one.load_factors[-1]) == 1.0


def _short_of_full_load(result: Result, name: str, one: Comparison) -> str:
    who = display_name(result, name)
    if one.load_factors.size:
        level = float(one.load_factors[-1])
        if one.agrees_up_to_load_factor is None:
            return f"{who} is known at load factor {level:.4g} only, there {_off(one)}."
        return f"with {who} the comparison ends at load factor {level:.4g}, there {_off(one)}."
    if one.surface is None and one.hausdorff is not None:
        apart = quantity(one.hausdorff.rms, "m", 2), quantity(one.hausdorff.max, "m", 2)
        return "the surfaces lie {} (root mean square) and at most {} apart.".format(*apart)
    if one.surface is None:
        return f"{who} and {_subject(result)[0]} have no load level in common."
    level = one.reference.surface.load_factor if one.reference.surface else 1.0
    return (
        f"the outline lies {quantity(one.surface.outline_rms, 'm', 2)} (root mean square) and at most "
        f"{quantity(one.surface.outline_max, 'm', 2)} off that of {who} at {level_name(result, level)}."
    )


def _subject(result: Result) -> tuple[str, bool]:
    """What the compared model is called, and whether that is plural."""
    assert result.model is not None
    path = result.paths[result.model]
    if not path.has_springs:
        return display_name(result, result.model), False
    several = sum(other.has_springs for other in result.paths.values()) > 1
    return display_name(result, result.model) if several else "springs", True


def _everyone(result: Result, names: Sequence[str]) -> str:
    if len(names) == 1:
        return display_name(result, names[0])
    return "both references" if len(names) == 2 else f"all {len(names)} references"


def _driven_by_motion(result: Result) -> bool:
    return result.problem.stated and result.problem.loading.driven_by_motion


def _by_displacement(result: Result) -> bool:
    """Whether a displacement was controlled, and the load factor found."""
    states = [state for path in result.paths.values() for state in path.states if not state.critical]
    return any(state.level is not None and abs(state.level - state.load_factor) > 1e-9 for state in states)


def _full(result: Result) -> str:
    if _by_displacement(result):
        return "full displacement"
    return "full motion" if _driven_by_motion(result) else "full load"


def _first(path: Solution, troubled: Callable[[State], bool]) -> str:
    """The first load level with trouble, as the end of a sentence."""
    levels = [state.load_factor for state in path.states if troubled(state)]
    return f", first at load factor {levels[0]:.4g}" if levels else ""


def _listed(parts: Sequence[str], last: str = " and ") -> str:
    return last.join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else parts[0]


def _capital(sentence: str) -> str:
    if "." in sentence.split(" ")[0]:  # a file's name
        return sentence
    return sentence[:1].upper() + sentence[1:]
