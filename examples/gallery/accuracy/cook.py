"""
Cook's membrane: which elements and springs lock
================================================

A tapered panel is sheared. Elements and springs that are too stiff in bending converge
slowly, springs whose moduli are not those of the material converge to a wrong
deflection.
"""

import matplotlib.pyplot as plt

import truespring as ts

reference = 23.97  # converged deflection for a unit load
light = 1e-5  # share of the unit load, for small strains


def panel(n: int, element: str) -> ts.Problem:
    """48 wide, 44 high on the left and 16 on the right, n by n elements."""
    square = ts.rectangle((1.0, 1.0), (n, n), element)
    tapered = ts.mapped(square, lambda x, y: (48 * x, 44 * x + y * (44 - 28 * x)))
    return ts.Problem(
        tapered,
        ts.Material(young=1.0, poisson=1 / 3),
        ts.PlaneStress(1.0),
        supports=ts.Fixed("left"),
        loads=ts.Force("right", (0.0, light)),
    )


# %%
# The deflection of the middle of the loaded side, with E = t = 1 and nu = 1/3, is 23.9
# to 24.0 in the literature (Cook, *J. Struct. Div. ASCE* 100, 1974).
models = {
    "triangles, linear": ("triangle", ts.Fem(law="linear", element="linear")),
    "quadrilaterals": ("quadrilateral", ts.Fem(law="linear", element="linear")),
    "triangles, quadratic": ("triangle", ts.Fem(law="linear", element="quadratic")),
    "springs (gaussian), quadratic": (
        "triangle",
        ts.Springs(rule="gaussian", element="quadratic"),
    ),
    "springs (lloyd)": ("triangle", ts.Springs(rule="lloyd")),
}
counts = (2, 4, 8, 16, 32)
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
found = {}
for name, (element, model) in models.items():
    solutions = [
        ts.solve(panel(n, element), model, ts.Newton(load_steps=1)) for n in counts
    ]
    tips = [ts.nearest_node(solution.problem.mesh, (48, 52)) for solution in solutions]
    found[name] = [
        s.states[-1].displacement[tip, 1] / light
        for s, tip in zip(solutions, tips, strict=True)
    ]
    ax.semilogx(counts, found[name], "o-", base=2, label=name)
    print(f"{name}: {found[name][-1]:.2f} on {counts[-1]} x {counts[-1]} elements")

ax.axhline(reference, color="black", ls="--", label="reference")
ax.set(
    xlabel="elements along a side",
    ylabel="deflection",
    title="Cook's membrane",
    xticks=counts,
    xticklabels=counts,
)
ax.legend(fontsize="small")

assert abs(found["triangles, quadratic"][-1] / reference - 1) < 0.005
assert abs(found["springs (gaussian), quadratic"][-1] / reference - 1) < 0.02
assert abs(found["springs (lloyd)"][-1] / reference - 1) > 0.2

# %%
# The panel and its stress.
ts.solve(panel(16, "quadrilateral"), ts.Fem(law="linear")).plot(color="stress")
# sphinx_gallery_thumbnail_number = -1
