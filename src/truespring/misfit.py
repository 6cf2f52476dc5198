"""Detect that two bodies differ by unit, axes or origin only; nothing is corrected."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints, along_axes, in_space
from truespring.comparison import Comparison
from truespring.solution import Solution

# Bounding boxes are equal if their corners differ by less than this share of their diagonal, undeformed or deformed.
_SAME_BOX = 0.02
_SAME_DEFORMED_BOX = 0.2

# Ratios of the unit of a file to the unit that was assumed.
_FACTORS = (1e-3, 1e3, 1e-2, 1e2, 10.0, 0.1, 1e-6, 1e6, 0.0254, 1 / 0.0254, 0.3048, 1 / 0.3048)

# A cloud of points fits a body if this share of its extent along each axis lies within that of the body.
_SHARED = 0.5

#: Number of points at which displacements are compared.
_SAMPLE = 400

# Other axes or units are reported if the error of the displacement is above the first number, and theirs is below this
# share of it.
_POOR, _BETTER = 0.5, 0.2


@dataclass(frozen=True)
class Misfit:
    """A change of unit, axes and origin that places one body on another.

    Attributes:
        factor: factor of the lengths [-].
        axes: axes of the body along x, y and z, such as ("x", "z", "-y").
        shift: translation after factor and axes [m].
    """

    factor: float = 1.0
    axes: tuple[str, ...] = ("x", "y", "z")
    shift: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class _Box:
    """Bounding box: `lower` and `upper` corner [m], shape (3,), NaN along z for a plane body; `filled` by elements."""

    lower: Floats
    upper: Floats
    filled: bool

    @property
    def diameter(self) -> float:
        return float(np.linalg.norm(np.nan_to_num(self.upper - self.lower)))


def find_misfit(path: Solution, reference: Solution, factors: Sequence[float] = _FACTORS) -> Misfit | None:
    """Return the change that places a body on the reference; None if it lies there already, or if there is no such one.

    `factors` are the factors of lengths to try: ratios of units to the unit that was assumed.
    """
    mine, theirs, tolerance = _boxes(path, reference)
    if _fits(mine, theirs, tolerance):
        return None
    best, least = None, np.inf
    for candidates in _tiers(mine, theirs, tolerance, factors):
        for one in candidates:
            error = _sampled_error(path, reference, one)
            # Prefer few changes, unless another one reduces the error of the displacement by much.
            if best is None or error < _BETTER * least or (error < least and _changes(one) == _changes(best)):
                best, least = one, error
        if least < _POOR:
            break
    return best


def _changes(one: Misfit) -> int:
    """Return how many of factor, axes and shift differ from the default."""
    return (one.factor != 1) + (one.axes != ("x", "y", "z")) + any(one.shift)


def same_place(path: Solution, reference: Solution) -> bool:
    """Return whether the bounding boxes of two bodies are equal, to a tolerance."""
    return _fits(*_boxes(path, reference))


def _boxes(path: Solution, reference: Solution) -> "tuple[_Box, _Box, float]":
    """Return the bounding boxes of two bodies, and their tolerance as a share of the diagonal."""
    if path.states and reference.states:
        return _box(path), _box(reference), _SAME_BOX
    level = (reference if path.states else path).load_factor  # one is known deformed only: compare both deformed
    return _box(path, level), _box(reference, level), _SAME_DEFORMED_BOX


def displacement_misfit(comparison: Comparison) -> Misfit | None:
    """Return axes or a factor that reduce the error of the displacement by much, for bodies in the same place.

    The axes are those of the whole body, if its place remains right, or of the displacement alone; the factor is that
    of the displacement alone. None if the displacements agree, or if nothing reduces the error.
    """
    model, reference = comparison.known_on
    if not comparison.load_factors.size or not comparison.rms_errors[-1] > _POOR:
        return None
    mine, theirs = _box(model), _box(reference)
    plain = Misfit()
    turned = [one for axes in _axes() if _fits(_moved(mine, one := Misfit(axes=axes)), theirs, _SAME_BOX)]
    pairs = [(one, one) for one in turned]  # changes of positions and of displacements
    pairs += [(plain, one) for one in (*turned, *(Misfit(factor) for factor in _FACTORS))]
    errors = [_sampled_error(model, reference, *pair) for pair in pairs]
    best = int(np.argmin(errors))
    return pairs[best][1] if errors[best] < _BETTER * _sampled_error(model, reference, plain) else None


def _box(path: Solution, level: float | None = None) -> _Box:
    """Return the bounding box of a body, undeformed or at a level."""
    if path.states:
        state = None if level is None else path.at(level)
        points = path.whole.points if state is None else state.all_positions
    else:
        only = path.surface or path.shell
        points = np.zeros((1, 3)) if only is None else only.points
    unknown = np.full(3 - points.shape[1], np.nan)
    filled = not path.states or bool(path.whole.cells)
    return _Box(np.append(points.min(axis=0), unknown), np.append(points.max(axis=0), unknown), filled)


def _fits(mine: _Box, theirs: _Box, tolerance: float) -> bool:
    """Return whether two boxes are equal; if one is of points alone, whether most of it lies within the other.

    Points whose extent is a tiny part of the body do not fit: their unit is wrong.
    """
    room = tolerance * max(mine.diameter, theirs.diameter)
    low, high = mine.lower - theirs.lower, mine.upper - theirs.upper
    known = ~(np.isnan(low) | np.isnan(high))
    plane = np.isnan(mine.lower).any() or np.isnan(theirs.lower).any()
    if not known[: 2 if plane else 3].all():
        return False
    if mine.filled and theirs.filled:
        return bool((np.abs(low[known]) <= room).all() and (np.abs(high[known]) <= room).all())
    cloud, body = (theirs, mine) if mine.filled else (mine, theirs)
    shared = np.minimum(cloud.upper, body.upper) - np.maximum(cloud.lower, body.lower) + 2 * room
    lost = cloud.diameter < tolerance * body.diameter
    return bool((shared[known] >= _SHARED * (cloud.upper - cloud.lower)[known]).all()) and not lost


def _moved(box: _Box, misfit: Misfit) -> _Box:
    """Return a box after a change of unit, axes and origin."""
    ends = np.stack([along_axes(corner[None], misfit.axes)[0] for corner in (box.lower, box.upper)])
    low, high = misfit.factor * np.fmin(*ends), misfit.factor * np.fmax(*ends)
    return _Box(low + np.array(misfit.shift), high + np.array(misfit.shift), box.filled)


def _axes() -> Iterator[tuple[str, ...]]:
    """Yield all axes but ("x", "y", "z"), right-handed ones first."""
    order = [
        (float(np.linalg.det(along_axes(np.eye(3), axes))), axes)
        for letters in itertools.permutations("xyz")
        for signs in itertools.product(("", "-"), repeat=3)
        for axes in [tuple(sign + letter for sign, letter in zip(signs, letters, strict=True))]
    ]
    yield from (axes for handed, axes in sorted(order, key=lambda one: -one[0]) if axes != ("x", "y", "z"))


def _tiers(mine: _Box, theirs: _Box, tolerance: float, factors: Sequence[float]) -> Iterator[Iterator[Misfit]]:
    """Yield the changes that fit, in tiers: unit, axes, origin, then two and three of them."""
    units = [Misfit(factor) for factor in factors if abs(factor - 1) > 1e-9]
    axes = [Misfit(axes=one) for one in _axes()]
    both = [Misfit(one.factor, other.axes) for one in units for other in axes]
    yield (one for one in units if _fits(_moved(mine, one), theirs, tolerance))
    yield (one for one in axes if _fits(_moved(mine, one), theirs, tolerance))
    if mine.filled and theirs.filled:
        yield _shifted([Misfit()], mine, theirs, tolerance)
    yield (one for one in both if _fits(_moved(mine, one), theirs, tolerance))
    if mine.filled and theirs.filled:
        yield _shifted(units, mine, theirs, tolerance)
        yield _shifted(axes, mine, theirs, tolerance)
        yield _shifted(both, mine, theirs, tolerance)


def _shifted(several: list[Misfit], mine: _Box, theirs: _Box, tolerance: float) -> Iterator[Misfit]:
    """Yield changes of several candidates that fit with a translation."""
    for one in several:
        shift = np.nan_to_num(theirs.lower - _moved(mine, one).lower)
        moved = Misfit(one.factor, one.axes, tuple(float(f"{part:.6g}") for part in shift))
        if _fits(_moved(mine, moved), theirs, tolerance):
            yield moved


def _sampled_error(path: Solution, reference: Solution, places: Misfit, motion: Misfit | None = None) -> float:
    """Return the relative rms error of a body's displacement at some of its points after a change, 0 if not known.

    `places` changes the positions, `motion` the displacements (by default as the positions).
    """
    grid, other = path.whole, reference.whole
    state = path.states[-1] if path.states else None
    theirs = None if state is None else reference.at(state.level)
    if state is None or theirs is None or not other.fills:
        return 0.0
    some, change = _some(len(grid.points)), motion or places
    moved = change.factor * along_axes(in_space((state.all_positions - grid.points)[some]), change.axes)
    rest = places.factor * along_axes(in_space(grid.points[some]), places.axes) + np.array(places.shift)
    dim = min(other.dim, grid.dim)
    if other.dim == 3 and grid.dim == 2:
        rest[:, 2] = (other.points[:, 2].min() + other.points[:, 2].max()) / 2
    found = other.locate(rest[:, : other.dim])
    inside = ~found.outside
    if not inside.any():
        return np.inf
    target = found.carry(theirs.all_positions - other.points)[inside, :dim]
    size = float(np.linalg.norm(target))
    return float(np.linalg.norm(moved[inside, :dim] - target)) / size if size else np.inf


def _some(n_points: int) -> Ints:
    """Return the numbers of at most _SAMPLE points, evenly spaced."""
    return np.unique(np.linspace(0, n_points - 1, _SAMPLE).astype(np.int64))
