"""
A block slides down an incline
==============================

A soft block is let go on a rough plane. If the plane is steep enough it slides, with
the acceleration of Coulomb's law.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

length, gravity, slope = 0.10, 9.81, np.radians(30)


# %%
# The axes are those of the incline: gravity is turned, instead of the plane.
def slide(coefficient: float) -> ts.Solution:
    problem = ts.Problem(
        ts.rectangle((length, length / 2), (6, 3)),
        ts.Material(young=1e5, poisson=0.3, density=1000.0),
        ts.PlaneStress(length),
        loads=ts.Gravity((gravity * np.sin(slope), -gravity * np.cos(slope))),
        tools=[ts.HalfSpace("plane", (0.0, 1.0), (0.0, 0.0), friction=coefficient)],
        dynamics=ts.Dynamics(
            0.3,
            step=4e-3,
            scheme="bdf2",
            record=0.02,
            damping=ts.Damping(stiffness=2e-3),
        ),
    )
    return ts.solve(problem, ts.Springs(rule="gaussian"), ts.Newton(tolerance=1e-8))


# %%
# Coulomb: the speed is g (sin a - mu cos a) t; with a coefficient above tan a = 0.577
# the block sticks.
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
for coefficient in (0.0, 0.2, 0.4, 0.7):
    motion = slide(coefficient)
    time = np.array([state.moving.time for state in motion.states])
    speed = np.array([state.moving.velocity[:, 0].mean() for state in motion.states])
    exact = gravity * max(np.sin(slope) - coefficient * np.cos(slope), 0) * time
    print(f"friction {coefficient}: {speed[-1]:.3f} m/s, Coulomb {exact[-1]:.3f} m/s")
    assert np.abs(speed - exact).max() < 0.03
    ax.plot(time, exact, color="black", lw=0.8)
    ax.plot(time, speed, "o", label=f"friction {coefficient}")
ax.set(
    xlabel="time [s]",
    ylabel="speed [m/s]",
    title="Sliding down an incline of 30 degrees",
)
ax.legend()

# %%
# The block that sticks, sheared by its weight; displacements are enlarged.
motion.plot(color="displacement", magnify=10)
# sphinx_gallery_thumbnail_number = -1
