"""
Two tissues from a gmsh mesh
============================

A disc of soft tissue with a stiff lump is pressed from outside. The mesh file has
groups of elements and of sides; loads, supports and materials use their names.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

# %%
# The mesh, :download:`two_tissues.msh`, lies beside this script, with the .geo file
# that gmsh made it from. It is a quarter, in millimetres.
mesh = ts.read_mesh("two_tissues.msh", unit="mm")
print(mesh, sorted(mesh.element_groups), sorted(mesh.facet_groups))

lump, outer, pressure, poisson = 6e-3, 20e-3, 10.0, 0.4
soft, stiff = 3e3, 30e3  # Young's moduli [Pa]


def disc(pressure):
    return ts.Problem(
        mesh,
        ts.Material(soft, poisson),
        ts.PlaneStrain(thickness=0.01),
        regions=ts.Region("lump", ts.Material(stiff, poisson)),
        supports=[ts.Fixed("along x", fix=["y"]), ts.Fixed("along y", fix=["x"])],
        loads=ts.Pressure("outside", pressure),
    )


springs = ts.Springs(rule="gaussian", element="quadratic")
found = ts.solve(disc(pressure), springs, ts.Newton(load_steps=1))


# %%
# At small strain both parts follow Lamé: the radial displacement is A r in the lump, B
# r + C / r in the tissue, and the radial stress 2 (lambda + mu) B - 2 mu C / r²
# (Timoshenko and Goodier, *Theory of Elasticity*, section 28).
def moduli(young):
    mu = young / 2 / (1 + poisson)
    return mu, young * poisson / (1 + poisson) / (
        1 - 2 * poisson
    ) + mu  # mu, lambda + mu


(mu, both), (_, stiff_both) = moduli(soft), moduli(stiff)
conditions = [
    [lump, -lump, -1 / lump],  # displacement at the lump
    [2 * stiff_both, -2 * both, 2 * mu / lump**2],  # radial stress there
    [0, 2 * both, -2 * mu / outer**2],  # and outside
]
a, b, c = np.linalg.solve(conditions, [0, 0, -pressure])

radius = np.linalg.norm(mesh.nodes, axis=1)
moved = np.linalg.norm(found.states[-1].positions, axis=1) - radius
along = np.linspace(1e-4, outer, 200)
exact = np.where(along < lump, a * along, b * along + c / along)
error = np.abs(moved - np.interp(radius, along, exact)).max() / np.abs(exact).max()
print(f"largest difference from the closed form: {100 * error:.2f} %")
assert error < 0.01

fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
ax.plot(1e3 * along, 1e6 * exact, color="black", label="Lamé")
ax.plot(1e3 * radius, 1e6 * moved, ".", label=found.label)
ax.set(
    xlabel="radius [mm]",
    ylabel="radial displacement [µm]",
    title="A stiff lump in soft tissue",
)
ax.legend()

# %%
# A hundred times the pressure: the tissue yields, the lump stays.
far = ts.solve(disc(100 * pressure), springs, ts.Newton(load_steps=5))
far.plot(color="displacement")
# sphinx_gallery_thumbnail_number = -1
