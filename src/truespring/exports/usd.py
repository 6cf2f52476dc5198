"""Universal Scene Description as text: the surface with a time sample for each load level.

Source: https://openusd.org/release/spec_usdpreviewsurface.html and UsdGeomMesh, UsdGeomBasisCurves of
https://openusd.org/release/api/; the files are read by usd-core in tests.
"""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from truespring.arrays import Floats
from truespring.exports.exported import Exported
from truespring.exports.shown import SECONDS, Shown


def usd(exported: Exported) -> Mapping[str, str | bytes]:
    """Return surface.usda."""
    return {"surface.usda": "\n".join([*_lines(Shown(exported)), ""])}


def _lines(shown: Shown) -> Iterator[str]:
    levels = shown.levels
    # The ends of a line are points of their own.
    chosen = shown.rows.ravel() if shown.is_lines else np.arange(len(levels[0][1]))
    yield "#usda 1.0"
    yield "("
    yield '    defaultPrim = "body"'
    yield f'    doc = """{_safe(shown.exported.header)}"""'
    yield "    metersPerUnit = 1"
    yield '    upAxis = "Y"'
    yield "    startTimeCode = 0"
    yield f"    endTimeCode = {len(levels) - 1}"
    yield f"    timeCodesPerSecond = {max(len(levels) - 1, 1) / SECONDS!r}"
    yield ")"
    yield ""
    yield f'def {"BasisCurves" if shown.is_lines else "Mesh"} "body"'
    yield "{"
    yield from (f"    {line}" for line in (_curves(shown) if shown.is_lines else _mesh(shown)))
    yield f"    point3f[] points = {_vectors(levels[-1][1][chosen])}"
    yield "    point3f[] points.timeSamples = {"
    yield from (f"        {number}: {_vectors(places[chosen])}," for number, (_, places) in enumerate(levels))
    yield "    }"
    yield "    float3[] extent.timeSamples = {"
    for number, (_, places) in enumerate(levels):
        yield f"        {number}: {_vectors(np.stack([places.min(axis=0), places.max(axis=0)]))},"
    yield "    }"
    yield f"    color3f[] primvars:displayColor = {_vectors(shown.linear_colours[chosen].astype(np.float32))} ("
    yield '        interpolation = "vertex"'
    yield "    )"
    yield f"    custom double[] loadFactors = {[factor for factor, _ in levels]!r}"
    yield "}"


def _mesh(shown: Shown) -> Iterator[str]:
    yield 'uniform token subdivisionScheme = "none"'
    yield "uniform bool doubleSided = 1"
    yield f"int[] faceVertexCounts = {[3] * len(shown.rows)!r}"
    yield f"int[] faceVertexIndices = {shown.rows.ravel().tolist()!r}"


def _curves(shown: Shown) -> Iterator[str]:
    size = 1e-3 * float(np.ptp(shown.levels[0][1], axis=0).max())
    yield 'uniform token type = "linear"'
    yield f"int[] curveVertexCounts = {[2] * len(shown.rows)!r}"
    yield f"float[] widths = [{size:.3g}] ("
    yield '    interpolation = "constant"'
    yield ")"


def _vectors(values: Floats) -> str:
    return "[" + ", ".join(f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in values.tolist()) + "]"


def _safe(sentences: Iterable[str]) -> str:
    """Return sentences as lines of a string in triple quotes."""
    return "\n".join(sentences).replace("\\", "/").replace('"', "'")
