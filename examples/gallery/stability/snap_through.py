"""
Snap-through of a shallow arch
==============================

Two bars that lean on each other are pushed down until they snap through. The force is
known in closed form on the whole path; a clamped arch of Gaussian springs behaves
alike.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

span, rise = 1.0, 0.2  # half of the span, height [m]
stiffness = 1e3  # of a bar [N/m]

# %%
# Displacement control prescribes the displacement of the top, since the force decreases
# between the two limit points.
nodes = np.array([[-span, 0.0], [0.0, rise], [span, 0.0]])
truss = ts.SpringNetwork(
    nodes, springs=[[0, 1], [1, 2]], stiffness=[stiffness, stiffness]
)
problem = ts.Problem(
    truss.mesh, supports=ts.Fixed([0, 2]), loads=ts.Force([1], (0.0, -1.0))
)
path = ts.solve(problem, truss, ts.DisplacementControl([1], "y", to=-0.45, steps=30))


# %%
# With the rest length L of the bars and their length l at the height h of the top, the
# force is 2 k (L - l) h / l.
def closed_form(height):
    rest, long = np.hypot(span, rise), np.hypot(span, height)
    return 2 * stiffness * (rest - long) * height / long


down = np.array([-state.displacement[1, 1] for state in path.states])
exact = closed_form(rise - down)
error = np.abs(path.load_factors - exact).max() / exact.max()
limits = [state.load_factor for state in path.states if state.critical == "limit point"]
print(f"limit points at {limits[0]:.4f} N and {limits[1]:.4f} N, error {error:.1e}")
assert error < 1e-8

# %%
# An arch of rubber: a strip that is bent to a shallow arc, with both ends clamped,
# pushed down in the middle.
flat = ts.rectangle((2 * span, 0.04), (60, 2))
arch = ts.mapped(flat, lambda x, y: (x - span, y + rise * np.sin(np.pi * x / 2 / span)))
top = np.flatnonzero(np.isclose(arch.nodes[:, 0], 0))
rubber = ts.Problem(
    arch,
    ts.Material(1e6, 0.4),
    ts.PlaneStress(0.04),
    [ts.Fixed("left"), ts.Fixed("right")],
    ts.Force(top, (0.0, -1.0)),
)
bent = ts.solve(
    rubber,
    ts.Springs(rule="gaussian"),
    ts.DisplacementControl(top, "y", to=-0.45, steps=18),
)

fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
ax.plot(down, exact, color="black", label="two bars, closed form")
ax.plot(down, path.load_factors, "o", label="two bars")
ax.plot(
    [-state.displacement[top, 1].mean() for state in bent.states],
    bent.load_factors,
    label="arch of rubber",
)
ax.axhline(0, color="grey", lw=0.5)
ax.set(xlabel="motion of the top [m]", ylabel="force [N]", title="Snap-through")
ax.legend()

# %%
# The arch has snapped through.
bent.plot(color="displacement")
# sphinx_gallery_thumbnail_number = -1
