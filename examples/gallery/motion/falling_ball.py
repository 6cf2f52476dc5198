"""
A soft ball falls on a plane
============================

A disc of rubber falls, is flattened by the impact, and rebounds. Before it touches, its
centre follows the free fall; its energies keep their sum.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.collections import PolyCollection

import truespring as ts

radius, drop, gravity = 0.03, 0.10, 9.81


# %%
# A square of elements becomes a disc: its rings become circles, the more the nearer
# they are to the edge.
def rounded(x, y):
    x, y = x - 1, y - 1
    ring = np.maximum(np.abs(x), np.abs(y))
    circle = ring / np.maximum(np.hypot(x, y), 1e-12)
    scale = radius * (ring * circle + (1 - ring) * 0.8)
    return scale * x, scale * y + drop + radius


disc = ts.mapped(ts.rectangle((2.0, 2.0), (10, 10)), rounded)

# %%
# The scheme "leapfrog" keeps the energy. The floor is as soft as a layer of rubber, so
# that steps of 0.1 ms resolve the impact.
problem = ts.Problem(
    disc,
    ts.Material(young=40e3, poisson=0.45, density=1000.0),
    ts.PlaneStrain(thickness=0.01),
    loads=ts.Gravity((0.0, -gravity)),
    tools=[ts.HalfSpace("floor", (0.0, 1.0), (0.0, 0.0), stiffness=10 * 40e3 / radius)],
    dynamics=ts.Dynamics(0.32, step=1e-4, scheme="leapfrog", record=4e-3),
)
motion = ts.solve(problem, ts.Springs(rule="gaussian"), ts.Newton(tolerance=1e-8))

# %%
# Free fall: the centre of mass is at h - g t² / 2 until the lowest point touches, at
# sqrt(2 h / g).
time = np.array([state.moving.time for state in motion.states])
shares = problem.mass / problem.mass.sum()
height = np.array([shares @ state.positions[:, 1] for state in motion.states]) - radius
touches = np.sqrt(2 * drop / gravity)
before = time < touches - 1e-3
assert np.abs(height - (drop - gravity * time**2 / 2))[before].max() < 1e-6 * drop
energies = [state.moving.energies for state in motion.states]
total = np.array([one.total for one in energies])
fallen = problem.mass.sum() * gravity * drop
print(
    f"touches after {1e3 * touches:.1f} ms, "
    f"the sum of energies changes by {np.ptp(total) / fallen:.1e} of m g h"
)
assert np.ptp(total) < 0.02 * fallen

fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
ax.plot(time, [1e3 * one.kinetic for one in energies], label="kinetic")
ax.plot(time, [1e3 * one.elastic for one in energies], label="elastic")
ax.plot(time, 1e3 * (total - total[0]), label="change of the sum", color="black")
ax.set(xlabel="time [s]", ylabel="energy [mJ]", title="A soft ball falls")
ax.legend()

# %%
# A film by matplotlib; ``motion.animate("ball.gif")`` writes one in a line.
fig, ax = plt.subplots(figsize=(4, 4), dpi=60, layout="constrained")
ax.set(
    xlim=(-0.07, 0.07),
    ylim=(-0.005, 0.17),
    aspect="equal",
    xlabel="x [m]",
    ylabel="y [m]",
)
ax.axhspan(-0.005, 0, color="grey")
ball = ax.add_collection(PolyCollection([], ec="navy", fc="#8fbddb", lw=0.5))


def draw(frame):
    ball.set_verts(motion.states[frame].positions[disc.elements])


film = FuncAnimation(fig, draw, frames=range(0, len(time), 4), interval=80)
# sphinx_gallery_thumbnail_number = -1
