"""
Inflate a balloon past its limit point
======================================

The pressure in a rubber balloon grows, has a maximum, and falls while the balloon grows
on. Newton's method stops at the maximum; the arc length method goes past it.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

mu, poisson, inner, outer = 1e5, 0.495, 0.9, 1.0  # shear modulus [Pa], radii [m]


# %%
# An eighth of a sphere consists of three patches of hexahedra. Each is a third of a
# cube's surface that is projected on the sphere, and three planes of symmetry hold it.
def eighth_of_a_sphere(n: int, layers: int) -> ts.Mesh:
    box = ts.box((1.0, 1.0, 1.0), (n, n, layers))
    u, v, depth = box.nodes.T
    turned = np.stack(
        [np.tan(u * np.pi / 4), np.tan(v * np.pi / 4), np.ones(len(u))], axis=1
    )
    radius = (inner + (outer - inner) * depth) / np.linalg.norm(turned, axis=1)
    outward = radius[:, None] * turned
    patches = np.concatenate([np.roll(outward, axis, axis=1) for axis in range(3)])
    nodes, number = np.unique(np.round(patches, 12), axis=0, return_inverse=True)
    elements = np.concatenate([box.elements + patch * len(u) for patch in range(3)])
    return ts.Mesh(nodes, number.reshape(-1)[elements], "hexahedron")


mesh = eighth_of_a_sphere(n=4, layers=2)
radius = np.linalg.norm(mesh.nodes, axis=1)
inside = np.flatnonzero(np.isclose(radius, inner))
problem = ts.Problem(
    mesh,
    ts.Material(young=2 * mu * (1 + poisson), poisson=poisson),
    supports=[
        ts.Fixed(side, fix=[axis])
        for side, axis in (("left", "x"), ("bottom", "y"), ("back", "z"))
    ],
    loads=ts.Pressure(inside, 1.6 * mu * (outer - inner)),
)
arc = ts.ArcLength(load_steps=10, max_steps=20)
springs = ts.solve(problem, ts.Springs(rule="gaussian"), arc)


# %%
# An incompressible neo-Hookean sphere has a closed form: p = mu (2/b + 1/(2 b⁴) - 2/a -
# 1/(2 a⁴)) with the stretches a and b around the sphere at the inner and outer surface
# (Ogden, *Non-linear Elastic Deformations*).
def closed_form(a):
    b = (1 + (a**3 - 1) * (inner / outer) ** 3) ** (1 / 3)
    return mu * (2 / b + 0.5 / b**4 - 2 / a - 0.5 / a**4)


stretch = np.array(
    [
        np.linalg.norm(state.positions[inside], axis=1).mean() / inner
        for state in springs.states
    ]
)
pressure = problem.loads[0].pressure * springs.load_factors
(limit,) = [state for state in springs.states if state.critical == "limit point"]
exact = closed_form(np.linspace(1, 2.5, 2000)).max()
error = problem.loads[0].pressure * limit.load_factor / exact - 1
print(f"largest pressure: {exact:.1f} Pa exact, springs {100 * error:+.2f} %")
assert abs(error) < 0.02

fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
along = np.linspace(1, stretch.max())
ax.plot(
    along, closed_form(along) / 1e3, color="black", label="closed form, incompressible"
)
ax.plot(stretch, pressure / 1e3, "o", label=springs.label)
ax.set(
    xlabel="stretch of the inner surface [-]",
    ylabel="pressure [kPa]",
    title="A balloon of rubber",
)
ax.legend()

# %%
# The last state, at almost twice the radius.
springs.plot(color="displacement", level=-1)
# sphinx_gallery_thumbnail_number = -1
