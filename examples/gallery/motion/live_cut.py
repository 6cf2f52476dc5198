"""
Pull and cut a body live
========================

A session moves a body in real time while it is pulled and cut, as in the browser by
``truespring live``. Here a script does it: a strip is pulled up and let go, then cut,
and its free part falls.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.collections import PolyCollection

import truespring as ts

gravity = 9.81
strip = ts.Problem(
    ts.rectangle((0.12, 0.03), (24, 6)),
    ts.Material(young=1.5e5, poisson=0.4, density=1000.0),
    ts.PlaneStress(thickness=0.01),
    supports=ts.Fixed("left"),
    loads=ts.Gravity((0.0, -gravity)),
    dynamics=ts.Dynamics(1.0, damping=ts.Damping(stiffness=5e-4), start="equilibrium"),
)

# %%
# Each frame lasts 5 ms. A grasp pulls the end up, and lets go. Then a blade passes
# through a column of elements from top to bottom, and the part without a support falls
# free.
frames, falling = [], []
x, y = strip.mesh.nodes.T
column = [np.isclose(x, 0.0625, atol=3e-3) & (y == side) for side in (0.03, 0.0)]
with ts.Live(strip, ts.Springs(rule="gaussian"), frame=5e-3) as live:
    corner = live.positions[ts.named_point(strip.mesh, "right-middle")]
    for frame in range(64):
        if frame < 36:
            live.pull(corner, to=corner + np.array([0.0005, 0.0018]) * frame)
        elif frame == 38:
            live.release("pull")
            top, bottom = (live.positions[ends].mean(axis=0) for ends in column)
            live.cut(top + 0.2 * (top - bottom), bottom - 0.2 * (top - bottom))
            free = live.problem.mesh.nodes[:, 0] > 0.0625
        live.step()
        frames.append((live.positions, live.problem.mesh.elements))
        if frame >= 38:
            mass = live.problem.mass[free]
            falling.append(mass @ live.velocities[free, 1] / mass.sum())
print(live.notes[-1])

# %%
# The centre of the free part has the acceleration of gravity, whatever the strip does
# within.
fall = np.polyfit(np.arange(len(falling)) * 5e-3, falling, 1)[0]
print(f"acceleration of the free part: {fall:.4f} m/s²")
assert abs(fall + gravity) < 1e-3 * gravity

fig, ax = plt.subplots(figsize=(5, 4), dpi=60, layout="constrained")
ax.set(
    xlim=(-0.005, 0.17),
    ylim=(-0.06, 0.11),
    aspect="equal",
    xlabel="x [m]",
    ylabel="y [m]",
)
body = ax.add_collection(PolyCollection([], ec="navy", fc="#8fbddb", lw=0.5))


def draw(frame):
    positions, elements = frames[frame]
    body.set_verts(positions[elements])


film = FuncAnimation(fig, draw, frames=range(0, len(frames), 4), interval=100)
