"""
Calibrate springs to a reference
================================

Lloyd's springs on a coarse mesh are fitted to finite elements under one load, and
tested under a load that the fit has not seen.
"""

import matplotlib.pyplot as plt

import truespring as ts

newton = ts.Newton(load_steps=4)


def case(name, force):
    problem = ts.Problem(
        mesh=ts.rectangle(size=(0.16, 0.04), elements=(8, 2)),
        material=ts.Material(young=10e3, poisson=1 / 3),
        section=ts.PlaneStress(thickness=0.01),
        supports=ts.Fixed(on="left"),
        loads=ts.Force(on="right", total=force),
    )
    return ts.LoadCase(
        name,
        problem,
        ts.solve(problem, ts.Fem(law="neo-hookean"), newton),
        solver=newton,
    )


# %%
# A factor for each direction and row of the springs is fitted. There is one load case
# to fit, one to test.
down, aslant = case("down", (0.0, -0.04)), case("aslant", (0.03, 0.03))
lloyd = ts.Springs(rule="lloyd")
found = ts.calibrate(down, lloyd, unknowns="direction-row", held_out=aslant)
print(found.headline)
print(found.identifiability.sentence)

# %%
# The calibrated springs are a model for any load on this mesh. The pictures show the
# distance from the reference, before (left) and after (right).
fig, axes = plt.subplots(2, 2, figsize=(12, 6), layout="constrained")
for row, one in zip(axes, (down, aslant), strict=True):
    errors = []
    for ax, model, name in zip(
        row, (lloyd, found.model), ("rule", "calibrated"), strict=True
    ):
        springs = ts.solve(one.problem, model, newton)
        errors.append(ts.compare(springs, one.reference).rms_error)
        springs.plot(over=one.reference, color="distance", ax=ax)
        print(f"{one.name}, {name}: {100 * errors[-1]:.1f} % rms")
    assert errors[1] < 0.8 * errors[0]
