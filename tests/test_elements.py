"""What meshes tell of their elements at any size: determinants, forms, rows that are equal, facets of a selection."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from truespring import memory
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.mesh.rows import ascending, distinct_rows

KINDS = [name for name, kind in ELEMENT_KINDS.items() if kind.dim > 1]


def block(element: str, counts: int = 3) -> ts.Mesh:
    """A square or a cube of `counts` cells a side."""
    dim = ELEMENT_KINDS[element].dim
    return (ts.rectangle if dim == 2 else ts.box)((1.0,) * dim, (counts,) * dim, element)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    rows=st.lists(st.tuples(*[st.integers(-2, 3)] * 3), min_size=1, max_size=30),
    spread=st.sampled_from([1, 10**6, 2**60]),
)
def test_distinct_rows_are_those_of_numpy(rows: list[tuple[int, ...]], spread: int) -> None:
    """Packed into one number each or, where the columns spread far, into several."""
    given_rows = np.array(rows, dtype=np.int64) * np.array([1, spread, 1])
    found = distinct_rows(given_rows.T)
    unique, first, of, count = np.unique(given_rows, axis=0, return_index=True, return_inverse=True, return_counts=True)
    assert found.first.tolist() == first.tolist() and found.count.tolist() == count.tolist()
    assert found.of.tolist() == of.ravel().tolist()
    assert given_rows[found.first].tolist() == unique.tolist()
    assert np.stack(ascending(given_rows.T), axis=1).tolist() == np.sort(given_rows, axis=1).tolist()


@pytest.mark.parametrize("element", KINDS)
def test_jacobians_are_determinants_however_elements_are_sliced(element: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = block(element)
    moved = mesh.nodes + np.random.default_rng(2).uniform(-0.05, 0.05, mesh.nodes.shape)
    corners = np.array(mesh.kind.corners)
    at = moved[mesh.elements]
    expected = np.linalg.det(at[:, corners[:, 1:]] - at[:, corners[:, :1]])
    at_rest = mesh.nodes[mesh.elements]
    ratio = (expected / np.linalg.det(at_rest[:, corners[:, 1:]] - at_rest[:, corners[:, :1]])).min()
    measures = mesh.measures_at(moved)
    for size in (memory._SLICE, 1000):  # all at once, and a few elements at a time
        monkeypatch.setattr(memory, "_SLICE", size)
        assert mesh.corner_jacobians(moved) == pytest.approx(expected, rel=1e-11, abs=1e-15)
        assert mesh.smallest_area_ratio(moved) == pytest.approx(ratio, rel=1e-11)
        assert mesh.measures_at(moved) == pytest.approx(measures, rel=1e-13)
        assert ts.Mesh(mesh.nodes, mesh.elements, mesh.element).forms.of.tolist() == mesh.forms.of.tolist()


@pytest.mark.parametrize("element", KINDS)
def test_the_smallest_ratio_of_a_body_that_is_stretched(element: str) -> None:
    mesh = block(element)
    assert mesh.smallest_area_ratio(mesh.nodes) == 1.0
    stretch = np.array([2.0, 0.7, 1.1])[: mesh.dim]
    assert mesh.smallest_area_ratio(mesh.nodes * stretch) == pytest.approx(stretch.prod(), rel=1e-12)
    assert mesh.smallest_area_ratio(mesh.nodes * np.array([-1.0, 1.0, 1.0])[: mesh.dim]) == pytest.approx(-1.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_a_state_that_has_run_away_is_not_upright(value: float) -> None:
    mesh = block("hexahedron")
    gone = mesh.nodes.copy()
    gone[13] = [value, -value, value]
    assert not mesh.smallest_area_ratio(gone) > 0


FORMS = {"quadrilateral": 1, "triangle": 2, "hexahedron": 1, "tetrahedron": 6}


@pytest.mark.parametrize("element", FORMS)
def test_elements_that_a_translation_carries_into_each_other_are_of_one_form(element: str) -> None:
    forms = block(element, 5).forms
    assert len(forms.first) == FORMS[element] and forms.exact and forms.few
    assert forms.of[forms.first].tolist() == list(range(FORMS[element]))
    assert len(set(np.bincount(forms.of))) == 1  # as many of each
    assert forms.size == pytest.approx(0.2) and forms.largest == pytest.approx(0.2)
    assert forms.single == (FORMS[element] == 1)


def test_forms_that_differ_by_more_than_rounding_are_not_exact() -> None:
    mesh = ts.rectangle((3.0, 2.0), (6, 4))
    for shift, exact in ((1e-15, True), (1e-8, False)):
        nodes = mesh.nodes.copy()
        nodes[8, 0] += shift
        forms = ts.Mesh(nodes, mesh.elements).forms
        assert len(forms.first) == 1 and forms.exact == exact and forms.few == exact
    nodes[8, 0] += 1e-2
    assert len(ts.Mesh(nodes, mesh.elements).forms.first) == 5
    # Far away rounding is coarser, and no more is asked.
    assert ts.Mesh(mesh.nodes / 3 + 1e5, mesh.elements).forms.single


@pytest.mark.parametrize("element", KINDS)
def test_facets_within_a_selection(element: str) -> None:
    mesh = block(element)
    inside = mesh.nodes[:, 0] < 0.5
    facets, alone = mesh.facets_of(mesh.elements, inside)
    assert sorted(map(sorted, facets.tolist())) == sorted(
        sorted(facet) for facet in mesh.facets.tolist() if inside[facet].all()
    )
    assert sorted(map(sorted, facets[alone].tolist())) == sorted(
        sorted(facet) for facet in mesh.boundary.tolist() if inside[facet].all()
    )
