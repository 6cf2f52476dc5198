"""
Natural modes of a cantilever
=============================

The lowest natural frequencies of a bar of silicone, by Gaussian springs, beside those
of beam theory.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

young, density, length, depth = 1e6, 1100.0, 0.20, 0.01
problem = ts.Problem(
    ts.rectangle((length, depth), (40, 2), "triangle", diagonal="alternating"),
    ts.Material(young, poisson=0.45, density=density),
    ts.PlaneStress(thickness=0.01),
    supports=ts.Fixed("left"),
    stated=False,  # modes need no load
)
found = ts.modes(problem, ts.Springs(rule="gaussian", element="quadratic"), count=4)

# %%
# Beam theory: f = beta² / (2 pi) sqrt(E I / (rho A L⁴)) with beta = 1.875, 4.694, 7.855
# for bending, and a quarter of a wave along the bar, f = sqrt(E / rho) / (4 L)
# (Blevins, *Formulas for Natural Frequency and Mode Shape*, 1979). The theory leaves
# shear and rotary inertia out: it is too high for the third mode.
bending = (
    np.array([1.87510, 4.69409, 7.85476]) ** 2
    / (2 * np.pi)
    * np.sqrt(young * depth**2 / 12 / density)
    / length**2
)
theory = np.sort([*bending, np.sqrt(young / density) / 4 / length])
for frequency, exact in zip(found.frequencies, theory, strict=True):
    error = frequency / exact - 1
    print(f"{frequency:7.3f} Hz, theory {exact:7.3f} Hz ({100 * error:+.1f} %)")
assert np.abs(found.frequencies / theory - 1).max() < 0.04

# %%
# The shapes, coloured by the size of the displacement; the bar at rest is grey.
fig, axes = plt.subplots(4, 1, figsize=(6, 6.5), layout="constrained", sharex=True)
corners = problem.mesh.elements
for ax, shape, frequency in zip(axes, found.shapes, found.frequencies, strict=True):
    moved = problem.mesh.nodes + 0.03 * shape
    size = np.linalg.norm(shape, axis=1)
    ax.triplot(*problem.mesh.nodes.T, corners, color="lightgrey", lw=0.3)
    ax.tripcolor(*moved.T, corners, size, shading="gouraud")
    ax.set(title=f"{frequency:.2f} Hz", aspect="equal", ylim=(-0.035, 0.045), yticks=[])
axes[-1].set_xlabel("x [m]")
