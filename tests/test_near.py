"""The comparison of arrays that tests use accepts what pytest.approx accepts, and nothing else."""

import itertools

import numpy as np
import pytest

from tests.near import near

VALUES = (0.0, 1e-13, 2e-12, 1.0, 1 + 5e-7, 1 + 2e-6, -1.0, 1e6, np.inf, -np.inf, np.nan)
TOLERANCES = ({}, {"rel": 1e-6}, {"abs": 1e-6}, {"rel": 1e-3, "abs": 1e-9}, {"rel": 0, "abs": 0}, {"nan_ok": True})


@pytest.mark.parametrize("tolerance", TOLERANCES, ids=str)
def test_near_is_approx(tolerance: dict[str, float]) -> None:
    answers = set()
    for found, expected in itertools.product(VALUES, VALUES):
        answers.add(answer := found == pytest.approx(expected, **tolerance))
        assert (found == near(expected, **tolerance)) is answer, (found, expected)
        pair = np.array([1.0, found]), np.array([1.0, expected])
        assert (pair[0] == near(pair[1], **tolerance)) is answer
        assert (near(pair[1], **tolerance) == pair[0]) is answer
    assert answers == {True, False}
    assert np.ones(3) != near(np.ones((1, 3))) and np.ones(3) != near(np.ones(1)) and np.ones(3) == near(1.0)
