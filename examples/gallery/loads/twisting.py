"""
Twist a round bar
=================

One end of a round bar is turned by 120 degrees. The torque, and the force along the bar
that a twist causes at large strains, are compared with the closed form of Rivlin.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

mu, poisson, radius, length, angle = 1e5, 0.49, 0.01, 0.04, np.radians(120)


# %%
# A bar of squares becomes round: its rings of elements become circles, the more the
# nearer they are to the surface.
def rounded(x, y, z):
    x, z = x - 1, z - 1
    ring = np.maximum(np.abs(x), np.abs(z))
    circle = ring / np.maximum(np.hypot(x, z), 1e-12)
    scale = radius * (ring * circle + (1 - ring) * 0.8)
    return scale * x, y, scale * z


bar = ts.mapped(ts.box((2.0, length, 2.0), (8, 8, 8)), rounded)
problem = ts.Problem(
    bar,
    ts.Material(2 * mu * (1 + poisson), poisson),
    supports=[
        ts.Fixed("bottom"),
        ts.Fixed("top", rotation=angle, about=(0, length, 0), axis=(0, 1, 0)),
    ],
)
springs = ts.solve(problem, ts.Springs(rule="gaussian"), ts.Newton(load_steps=8))

# %%
# An incompressible neo-Hookean bar of radius a, twisted by t per length, needs the
# torque pi mu a⁴ t / 2 and the force -pi mu a⁴ t² / 4 on its ends; without this force
# it would lengthen (Rivlin, *Phil. Trans. R. Soc. A* 242, 1949).
supports = [springs.support_forces(state)[0] for state in springs.states]
torque = np.array([one.torque[1] for one in supports])
force = np.array([one.force[1] for one in supports])
twist = angle / length * springs.load_factors
exact = np.pi * mu * radius**4 / 2 * twist, -np.pi * mu * radius**4 / 4 * twist**2
for name, found, rivlin in zip(
    ("torque [N m]", "force [N]"), (torque, force), exact, strict=True
):
    print(f"{name}: {found[-1]:.4g}, Rivlin {rivlin[-1]:.4g}")
    assert abs(found[-1] / rivlin[-1] - 1) < 0.05

fig, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
turned = np.degrees(angle) * springs.load_factors
for ax, name, found, rivlin in zip(
    axes, ("torque [mN m]", "force [mN]"), (torque, force), exact, strict=False
):
    ax.plot(turned, 1e3 * rivlin, color="black", label="Rivlin")
    ax.plot(turned, 1e3 * found, "o", label=springs.label)
    ax.set(xlabel="rotation [degrees]", ylabel=name)
axes[0].legend()

# %%
# Springs near the surface are stretched along the helices of the twist.
springs.plot(color="stretch")
# sphinx_gallery_thumbnail_number = -1
