"""Merge duplicate points of results: those with equal position and displacement."""

from dataclasses import replace

import numpy as np

from truespring.mesh.joining import distinct_points
from truespring.reference.record import Record

# Tolerances, as fractions of the body's diameter and of the largest displacement: rounding in float32.
_SAME_PLACE, _ALIKE = 1e-7, 1e-5


def joined(record: Record) -> Record:
    """Return a record with duplicate points merged, and a note; duplicates have equal displacement at every level.

    Programs such as deal.II write the points of each cell separately. If some points at equal positions differ in
    displacement, as on the faces of a crack or of two bodies, no point is merged.
    """
    used = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(nodes.ravel() for nodes in record.cells.values())]))
    if not len(used) or not np.isfinite(record.points[used]).all():
        return record
    points = record.points[used]
    first, number = distinct_points(points, _SAME_PLACE * float(np.linalg.norm(np.ptp(points, axis=0))))
    n_twins = len(used) - len(first)
    if not n_twins:
        return record
    apart = 0.0
    for level in record.levels:
        moved = level.displacement[used]
        largest = float(np.nanmax(np.abs(moved), initial=0.0)) or 1.0
        gap = np.abs(moved - moved[first][number])
        apart = max(apart, float(np.nanmax(gap, initial=0.0)) / largest)
    if apart > _ALIKE:
        note = (
            f"{n_twins} of {len(used)} points coincide with another one and separate, by up to "
            f"{apart:.2g} of the largest displacement: they were not merged, and faces between them count as surface"
        )
        return replace(record, notes=(*record.notes, note))
    kept = np.ones(len(record.points), dtype=bool)
    kept[used] = False
    kept[used[first]] = True
    new = np.cumsum(kept) - 1
    new[used] = new[used[first]][number]
    return replace(
        record,
        points=record.points[kept],
        cells={kind: new[nodes] for kind, nodes in record.cells.items()},
        levels=tuple(replace(level, displacement=level.displacement[kept]) for level in record.levels),
        names=tuple(name for name, stays in zip(record.names, kept, strict=False) if stays),
        notes=(
            *record.notes,
            f"{n_twins} of {len(used)} points coincide with another one and move with it: they were merged",
        ),
    )
