"""
Buckling of a column
====================

A slender column is clamped below and compressed from above. The load at which it
buckles is compared with Euler's, and the way it bends afterwards with Euler's elastica.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import truespring as ts

young, length, width, thickness = 1e6, 0.40, 0.01, 0.01
euler = np.pi**2 * young * (thickness * width**3 / 12) / (4 * length**2)


# %%
# The arc length method follows the straight column past the load at which it becomes
# unstable, and locates this bifurcation. Quadratic Gaussian springs do not lock in
# bending.
def column(*loads):
    mesh = ts.rectangle((width, length), (2, 80), "triangle", diagonal="alternating")
    return ts.Problem(
        mesh,
        ts.Material(young, 0.3),
        ts.PlaneStress(thickness),
        ts.Fixed("bottom"),
        loads,
    )


model = ts.Springs(rule="gaussian", element="quadratic")
straight = ts.solve(
    column(ts.Force("top", (0.0, -1.2 * euler))), model, ts.ArcLength(load_steps=6)
)
(critical,) = [state for state in straight.states if state.critical == "bifurcation"]
print(f"critical load: {1.2 * critical.load_factor:.4f} times Euler's pi² EI / (4 L²)")
assert abs(1.2 * critical.load_factor - 1) < 0.01

# %%
# A small force sideways, a thousandth of the load, chooses one of the two sides: the
# column bends far.
bent = ts.solve(
    column(ts.Force("top", (2e-3 * euler, -2.0 * euler))),
    model,
    ts.Newton(load_steps=20),
)
tip = ts.named_point(bent.problem.mesh, "top-middle")


# %%
# Euler's elastica: P L² / EI = K(m)², sideways 2 sqrt(m) / K(m), downwards 2 - 2 E(m) /
# K(m), with the complete elliptic integrals of the parameter m (Timoshenko and Gere,
# *Theory of Elastic Stability*, section 2.7).
def elastica(load):
    m = brentq(lambda m: ellipk(m) - np.pi / 2 * np.sqrt(load), 1e-12, 1 - 1e-12)
    return 2 * np.sqrt(m) / ellipk(m), 2 - 2 * ellipe(m) / ellipk(m)


loads = np.linspace(1.0001, 2, 60)
sideways = [elastica(load)[0] for load in loads]
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
ax.plot([0, 0, *sideways], [0, 1, *loads], color="black", label="elastica")
ax.plot(
    [state.displacement[tip, 0] / length for state in bent.states],
    2 * bent.load_factors,
    "o",
    label=bent.label,
)
ax.set(
    xlabel="sideways motion of the top / length",
    ylabel="load / Euler's load",
    title="A column buckles",
)
ax.legend()

error = bent.states[-1].displacement[tip, 0] / length / elastica(2.0)[0] - 1
print(f"top at twice the load: {100 * error:+.2f} % from the elastica")
assert abs(error) < 0.01

# %%
# The column at twice Euler's load: its springs are compressed inside of the bend, and
# extended outside.
bent.plot(color="stretch")
# sphinx_gallery_thumbnail_number = -1
