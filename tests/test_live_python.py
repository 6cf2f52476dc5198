"""Live sessions from Python: the example of the docstring, and a loop as in reinforcement learning."""

import doctest

import numpy as np
import pytest

from truespring.live import Live

from .test_examples import script


def test_the_example_of_the_docstring_runs() -> None:
    (found,) = [one for one in doctest.DocTestFinder(recurse=False).find(Live, "Live") if one.examples]
    assert doctest.DocTestRunner().run(found).failed == 0


def test_an_agent_brings_the_tip_to_its_target_and_episodes_repeat() -> None:
    gym = script("gym_loop")
    world = gym.Reach(frames=80)
    rewards, forces = gym.episode(world)
    assert -rewards[0] > 1.0  # edges away
    assert -rewards[-1] < 0.02
    assert forces[-1] > 0
    assert gym.episode(world) == (rewards, forces)
    np.testing.assert_array_equal(gym.episode(gym.Reach(frames=80))[0], rewards)


def test_gym_loop_prints_how_near_the_tip_came(capsys: pytest.CaptureFixture[str]) -> None:
    script("gym_loop").main()
    assert "edges from the target" in capsys.readouterr().out
