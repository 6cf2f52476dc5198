"""A loop as in reinforcement learning: an agent pulls the tip of a soft beam to a target, without a browser.

`Reach` has the methods of a gymnasium environment and needs no further package: wrap it in `gymnasium.Env` by deriving
from both. The agent here is a controller of one line.
"""

from typing import Any

import numpy as np

import truespring as ts


class Reach:
    """Bring the tip of a beam, held by a grasp, to a target."""

    def __init__(self, edge: float = 0.01, frames: int = 120) -> None:
        """Build a beam of four by one by one cubes of an edge [m]; an episode has a number of frames of 1/60 s."""
        beam = ts.Problem(
            ts.box((4 * edge, edge, edge), (4, 1, 1)),
            ts.Material(young=3000.0, poisson=0.4, density=1000.0),
            supports=ts.Fixed(on="left"),
            loads=ts.Gravity((0.0, 0.0, -9.81)),
            dynamics=ts.Dynamics(1.0, damping=ts.Damping(mass=10.0), start="equilibrium"),
        )
        self.live = ts.Live(beam, ts.Springs(rule="gaussian"))
        self.tip = ts.nearest_node(beam.mesh, (4 * edge, edge, edge))
        self.edge, self.frames = edge, frames
        self.target = beam.mesh.nodes[self.tip] + np.array([-0.5, 0.8, 0.6]) * edge

    def reset(self) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; return the observation: place, velocity and way to the target of the tip, shape (9,)."""
        self.live.restart()
        self.hand = self.live.positions[self.tip]
        self.live.pull(self.tip, name="hand")
        return self._observed(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Move the hand by `action` [m], shape (3,), and the body by a frame."""
        self.hand = self.hand + np.clip(action, -0.1 * self.edge, 0.1 * self.edge)
        self.live.pull(self.tip, self.hand, name="hand")
        self.live.step()
        away = float(np.linalg.norm(self.live.positions[self.tip] - self.target))
        force = float(np.linalg.norm(self.live.forces["hand"]))
        reached, ended = away < 0.02 * self.edge, self.live.log.frames >= self.frames
        return self._observed(), -away / self.edge, reached, ended, {"force": force}

    def _observed(self) -> np.ndarray:
        place, velocity = self.live.positions[self.tip], self.live.velocities[self.tip]
        return np.concatenate([place, velocity, self.target - place])


def episode(world: Reach) -> tuple[list[float], list[float]]:
    """Return rewards and forces [N] of an episode."""
    seen, _ = world.reset()
    rewards, forces = [], []
    while True:
        seen, reward, reached, ended, more = world.step(0.3 * seen[6:])  # the agent: a share of the way
        rewards.append(reward)
        forces.append(more["force"])
        if reached or ended:
            return rewards, forces


def main() -> None:
    """Run an episode and print how near the tip came."""
    rewards, forces = episode(Reach())
    print(f"{len(rewards)} frames, the tip ends {-rewards[-1]:.3f} edges from the target, held by {forces[-1]:.3g} N")


if __name__ == "__main__":
    main()
