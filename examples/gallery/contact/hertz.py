"""
Indentation by a sphere
=======================

A rigid sphere is pressed into a soft block. The force is compared with that of Hertz
for small indentation.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

young, poisson, radius, length, depth = 10e3, 0.3, 0.03, 0.12, 0.002


# %%
# By symmetry a quarter of the block is enough. Elements are small near the contact, and
# grow away from it.
def graded(share):
    """Coordinate of the node at a share of the elements of a side."""
    return length * (1 - (1.35 ** (9 * (1 - share)) - 1) / (1.35**9 - 1))


block = ts.mapped(
    ts.box((1.0, 1.0, 1.0), (9, 9, 9)),
    lambda x, y, z: (graded(x), graded(y), graded(z)),
)

# %%
# The sphere moves along a path: rows of the share of the way, and the place of its
# centre.
steps = 8
ball = ts.Sphere(
    "ball",
    radius,
    [
        [0, length, length + radius, length],
        [1, length, length + radius - depth, length],
    ],
    on="top",
)
problem = ts.Problem(
    block,
    ts.Material(young, poisson),
    supports=[
        ts.Fixed("bottom"),
        ts.Fixed("right", fix=["x"]),
        ts.Fixed("front", fix=["z"]),
    ],
    tools=[ball],
)
springs = ts.solve(problem, ts.Springs(rule="gaussian"), ts.Newton(load_steps=steps))

# %%
# Hertz: F = 4/3 E / (1 - nu²) sqrt(R) d^1.5 (Johnson, *Contact Mechanics*, section
# 4.2). The block is four times as thick as the radius, the contact is fewer than ten
# elements wide: expect a few percent.
indented = depth * springs.load_factors
force = 4 * np.array([-state.applied_force[1] for state in springs.states])
hertz = 4 / 3 * young / (1 - poisson**2) * np.sqrt(radius) * indented**1.5
print(f"force {1e3 * force[-1]:.1f} mN, Hertz {1e3 * hertz[-1]:.1f} mN")
assert abs(force[-1] / hertz[-1] - 1) < 0.08

fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
ax.plot(1e3 * indented, 1e3 * hertz, color="black", label="Hertz")
ax.plot(1e3 * indented, 1e3 * force, "o", label=springs.label)
ax.set(xlabel="indentation [mm]", ylabel="force [mN]", title="A sphere on a soft block")
ax.legend()

# %%
# The block from the side of the contact, which is at the near corner; displacements are
# enlarged.
springs.plot(color="displacement", magnify=5)
# sphinx_gallery_thumbnail_number = -1
