"""
A gripper lifts a soft block
============================

Two jaws close on a block and lift it from a table. Friction alone holds it: the jaws
carry its weight, if they press hard enough.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

size, gravity, thickness, friction = 0.04, 9.81, 0.04, 0.5

# %%
# The paths of the jaws are rows of time and place: they close for 0.2 s, lift until 0.6
# s, and rest.
close, lift = 0.003, 0.02
jaws = [
    ts.Block(
        name,
        (0.01, 0.02),
        [
            [0, start, size / 2],
            [0.2, end, size / 2],
            [0.3, end, size / 2],
            [0.6, end, size / 2 + lift],
            [0.8, end, size / 2 + lift],
        ],
        friction=friction,
    )
    for name, start, end in (
        ("left jaw", -0.006, -0.005 + close),
        ("right jaw", size + 0.006, size + 0.005 - close),
    )
]
table = ts.HalfSpace("table", (0.0, 1.0), (0.0, 0.0), friction=friction)
problem = ts.Problem(
    ts.rectangle((size, size), (8, 8)),
    ts.Material(young=10e3, poisson=0.45, density=1000.0),
    ts.PlaneStress(thickness),
    loads=ts.Gravity((0.0, -gravity)),
    tools=[*jaws, table],
    dynamics=ts.Dynamics(
        0.8, step=5e-3, scheme="bdf2", record=0.02, damping=ts.Damping(stiffness=5e-3)
    ),
)
motion = ts.solve(problem, ts.Springs(rule="gaussian"), ts.Newton(tolerance=1e-8))

# %%
# At the end the block hangs between the jaws: the friction on both carries its weight,
# the table nothing.
weight = problem.mass.sum() * gravity
time = np.array([state.moving.time for state in motion.states])
force = np.array([[tool.force for tool in state.touches] for state in motion.states])
carried = -force[:, :2, 1].sum(axis=1)
print(f"weight {1e3 * weight:.1f} mN, carried by the jaws {1e3 * carried[-1]:.1f} mN")
assert abs(carried[-1] / weight - 1) < 0.01 and abs(force[-1, 2, 1]) < 1e-3 * weight

fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
ax.plot(time, 1e3 * carried, label="friction of both jaws")
ax.plot(time, -1e3 * force[:, 2, 1], label="force on the table")
ax.plot(time, 1e3 * np.abs(force[:, 0, 0]), label="pressing force of a jaw")
ax.axhline(1e3 * weight, color="black", ls="--", label="weight")
ax.set(xlabel="time [s]", ylabel="force [mN]", title="A gripper lifts a block")
ax.legend(fontsize="small")

# %%
# The block at the end, squeezed between the jaws.
motion.plot(color="stress")
# sphinx_gallery_thumbnail_number = -1
