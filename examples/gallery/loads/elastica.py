"""
A cantilever under its own weight
=================================

A soft beam sags under gravity by more than half of its length. Its shape is that of the
heavy elastica.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_bvp

import truespring as ts

young, density, gravity = 4e6, 1000.0, 9.81
length, depth, thickness = 0.20, 0.005, 0.01

# %%
# Quadratic Gaussian springs bend without locking, with two triangles through the depth.
problem = ts.Problem(
    ts.rectangle((length, depth), (80, 2), "triangle", diagonal="alternating"),
    ts.Material(young, poisson=0.3, density=density),
    ts.PlaneStress(thickness),
    supports=ts.Fixed("left"),
    loads=ts.Gravity((0.0, -gravity)),
)
springs = ts.solve(
    problem, ts.Springs(rule="gaussian", element="quadratic"), ts.Newton(load_steps=8)
)

# %%
# The slope a of the heavy elastica along its length s satisfies EI a'' = -w (L - s)
# cos(a), with the weight w per length, a(0) = 0 and a'(L) = 0: it is clamped at one
# end, and has no moment at the other.
stiffness, weight = (
    young * thickness * depth**3 / 12,
    density * gravity * depth * thickness,
)


def bends(s, y):
    angle, curvature, _, _ = y
    return np.stack(
        [
            curvature,
            -weight / stiffness * (length - s) * np.cos(angle),
            np.cos(angle),
            -np.sin(angle),
        ]
    )


along = np.linspace(0, length, 101)
start = np.stack([along / length, np.ones(101) / length, along, -along / 2])
beam = solve_bvp(
    bends, lambda a, b: np.array([a[0], b[1], a[2], a[3]]), along, start, tol=1e-8
)
assert beam.success
x, y = beam.sol(along)[2:]

tip = ts.named_point(problem.mesh, "right-middle")
end = springs.states[-1].positions[tip] - (0, depth / 2)
error = np.hypot(end[0] - x[-1], end[1] - y[-1]) / length
print(f"the tip sags by {-1e3 * end[1]:.2f} mm, the elastica by {-1e3 * y[-1]:.2f} mm")
assert error < 0.005

fig, ax = plt.subplots(figsize=(6, 5), layout="constrained")
springs.plot(color="stress", ax=ax)
ax.plot(x, y + depth / 2, "--", color="black", label="heavy elastica")
ax.legend(loc="lower left")
