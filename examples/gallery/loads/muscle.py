"""
A muscle that contracts
=======================

A strip of muscle with fibres along its length becomes active, and shortens. The length
of a free strip has a closed form; a strip with one end held and a tendon at the other
lifts a weight.
"""

import numpy as np
from scipy.optimize import brentq

import truespring as ts

young, poisson, tension = 15e3, 0.45, 8e3  # passive muscle [Pa], active tension [Pa]
fibres = ts.Fibres(along=(1.0, 0.0))

# %%
# First the free strip, which contracts uniformly. The active tension acts along the
# fibres.
free = ts.Problem(
    ts.rectangle((0.08, 0.016), (10, 2)),
    ts.Material(young, poisson, fibres=fibres),
    ts.PlaneStrain(thickness=0.005),
    supports=[ts.Fixed("left", fix=["x"]), ts.Fixed("left-bottom")],
    loads=ts.ActiveTension(tension),
)
strip = ts.solve(free, ts.Springs(rule="gaussian"), ts.Newton(load_steps=4))


# %%
# The stress along a neo-Hookean strip, W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)²,
# balances the tension, and the stress across vanishes: two equations for two stretches.
def shortened(active):
    mu = young / 2 / (1 + poisson)
    lam = 2 * mu * poisson / (1 - 2 * poisson)

    def across(x):
        return brentq(lambda y: mu * (y - 1 / y) + lam * np.log(x * y) / y, 0.5, 3)

    def along(x):
        return mu * (x - 1 / x) + lam * np.log(x * across(x)) / x

    return brentq(lambda x: along(x) + active, 0.4, 1)


end = ts.named_point(free.mesh, "right-middle")
stretch = 1 + np.array([state.displacement[end, 0] for state in strip.states]) / 0.08
exact = np.array([shortened(tension * share) for share in strip.load_factors])
print(f"active strip: stretch {stretch[-1]:.6f}, closed form {exact[-1]:.6f}")
assert np.abs(stretch - exact).max() < 1e-6

# %%
# Now a muscle whose fibres run at 15 degrees to its length, with a stiff tendon, lifts
# a weight of 20 g.
angle = np.radians(15)
slanted = ts.Fibres(along=(np.cos(angle), np.sin(angle)), k1=4e3, k2=2)
belly, tendon = ts.Box((0.0, 0.0), (0.06, 0.016)), ts.Box((0.06, 0.0), (0.08, 0.016))
lifting = ts.Problem(
    ts.rectangle((0.08, 0.016), (20, 4)),
    ts.Material(young, poisson, fibres=slanted),
    ts.PlaneStress(thickness=0.005),
    regions=[ts.Region(tendon, ts.Material(300e3, poisson))],
    supports=[ts.Fixed("left")],
    loads=[ts.ActiveTension(tension, on=belly), ts.Force("right", (0.2, 0.0))],
)
muscle = ts.solve(lifting, ts.Springs(rule="gaussian"), ts.Newton(load_steps=5))
fem = ts.solve(lifting, ts.Fem(law="neo-hookean"), ts.Newton(load_steps=5))
muscle.plot(over=fem)
print(ts.compare(muscle, fem, probe="right-middle"))
