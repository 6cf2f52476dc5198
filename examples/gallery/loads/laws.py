"""
Stretch a strip by the laws of rubber
=====================================

The same strip, stretched to twice its length, by finite elements of several laws and by
two kinds of springs. Laws that agree at small strain differ widely; Gaussian springs
are the neo-Hookean law.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

import truespring as ts

young, poisson = 10e3, 1 / 3

# %%
# One end is moved, and the sides are free: the strip stretches uniformly.
problem = ts.Problem(
    ts.rectangle((0.16, 0.04), (8, 2)),
    ts.Material(young, poisson),
    ts.PlaneStress(thickness=0.01),
    supports=[
        ts.Fixed("left", fix=["x"]),
        ts.Fixed("left-bottom", fix=["y"]),
        ts.Fixed("right", fix=["x"], displacement=(0.16, 0.0)),
    ],
)
models = [
    ts.Fem(law=law)
    for law in ("linear", "saint-venant-kirchhoff", "neo-hookean", "hencky")
]
models += [ts.Springs(rule="gaussian"), ts.Springs(rule="lloyd")]

solutions = [ts.solve(problem, model, ts.Newton(load_steps=10)) for model in models]


def stress(solution):
    """Force over the undeformed area [Pa], by load level."""
    return np.array([solution.applied_force(state)[0] for state in solution.states]) / (
        0.01 * 0.04
    )


# %%
# Neo-Hookean, W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)²: both stresses across
# vanish (Bonet and Wood, *Nonlinear Continuum Mechanics for Finite Element Analysis*).
def neo_hookean(stretch):
    mu = young / 2 / (1 + poisson)
    lam = 2 * mu * poisson / (1 - 2 * poisson)
    across = brentq(lambda y: mu * (y**2 - 1) + lam * np.log(stretch * y**2), 0.3, 1.5)
    return mu * (stretch - 1 / stretch) + lam * np.log(stretch * across**2) / stretch


exact = neo_hookean(2.0)
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
for solution in solutions:
    pulled = stress(solution)
    ax.plot(
        1 + solution.load_factors,
        pulled / 1e3,
        "o" if solution.has_springs else "-",
        label=solution.label,
    )
    print(f"{solution.label}: {pulled[-1]:.1f} Pa at twice the length")
    if solution.label in ("neo-Hookean FEM", "springs (gaussian)"):
        assert abs(pulled[-1] / exact - 1) < 1e-6
print(f"neo-Hookean, closed form: {exact:.1f} Pa")
ax.set(
    xlabel="stretch",
    ylabel="force / undeformed area [kPa]",
    title="Four laws, two kinds of springs",
)
ax.legend()
