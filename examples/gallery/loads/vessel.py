"""
Pressure in a thick-walled vessel
=================================

A long pipe is pressed from inside. Gaussian springs and finite elements are compared
with the closed form of Lamé.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

young, poisson, inner, outer, pressure = 1e6, 0.3, 0.010, 0.020, 1e3

# %%
# A quarter of the pipe is a rectangle that is bent: its first coordinate is the radius,
# its second the angle. Its sides keep their names: the left one is inside, the bottom
# and the top one are planes of symmetry, which slide in themselves.
flat = ts.rectangle((outer - inner, np.pi / 2), (12, 24))
radius, angle = inner + flat.nodes[:, 0], flat.nodes[:, 1]
mesh = ts.mapped(flat, lambda r, a: ((inner + r) * np.cos(a), (inner + r) * np.sin(a)))

problem = ts.Problem(
    mesh,
    ts.Material(young, poisson),
    ts.PlaneStrain(thickness=1.0),
    supports=[ts.Fixed("bottom", fix=["y"]), ts.Fixed("top", fix=["x"])],
    loads=ts.Pressure("left", pressure),
)
springs = ts.solve(problem, ts.Springs(rule="gaussian"), ts.Newton(load_steps=1))
fem = ts.solve(problem, ts.Fem(law="neo-hookean"), ts.Newton(load_steps=1))


# %%
# Lamé's solution in plane strain (Timoshenko and Goodier, *Theory of Elasticity*,
# section 28) holds for small strains; here the pressure is a thousandth of Young's
# modulus.
def lame(r):
    factor = pressure * inner**2 / (outer**2 - inner**2) * (1 + poisson) / young
    return factor * ((1 - 2 * poisson) * r + outer**2 / r)


along = np.linspace(inner, outer)
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
ax.plot(1e3 * along, 1e6 * lame(along), color="black", label="Lamé")
for solution, mark in ((springs, "o"), (fem, "x")):
    outward = np.linalg.norm(solution.states[-1].positions, axis=1) - radius
    ax.plot(
        1e3 * radius[angle == 0], 1e6 * outward[angle == 0], mark, label=solution.label
    )
    error = outward[radius == inner].mean() / lame(inner) - 1
    print(f"{solution.label}: inner displacement {100 * error:+.2f} % from Lamé")
    assert abs(error) < 0.01
ax.set(
    xlabel="radius [mm]",
    ylabel="radial displacement [µm]",
    title="Pressure in a thick-walled pipe",
)
ax.legend()

# %%
# The stress is largest inside. The displacements are drawn a hundred times as large.
fem.plot(color="stress")
# sphinx_gallery_thumbnail_number = -1
