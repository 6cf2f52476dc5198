"""
Where springs can be trusted
============================

A validity map shows up to which load springs agree with converged finite elements, on
coarse and fine meshes.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

# %%
# The body is that of ``truespring new strip``; it is bent as a cantilever.
with TemporaryDirectory() as folder:
    study = ts.read_study(ts.new("strip", Path(folder) / "strip.toml"))
    found = ts.map_validity(
        study, loads=["bend"], rules=["lloyd", "gaussian"], ranges={"depth": (1, 6)}
    )
for verdict in found.verdicts:
    print(verdict)
print(f"{found.solves[0]} paths of springs were solved")

# %%
# Lines of equal error: the load along x, the elements through the depth along y.
fig, axes = plt.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained", sharey=True)
levels = [0, 1, 2, 5, 10, 100]
colors = ["#0b4f7d", "#3f87b8", "#8fbddb", "#d3e5f2", "#f7e6d8"]
for ax, one in zip(axes, found.maps, strict=True):
    depth, errors = one.smooth
    shown = ax.contourf(one.x, depth, 100 * np.abs(errors), levels, colors=colors)
    ax.set(title=f"{one.load.did}: {one.rule.words}", xlabel="deflection / length")
axes[0].set_ylabel("elements through the depth")
fig.colorbar(shown, ax=axes, label="error [%]")

lloyd, gaussian = found.maps
assert np.abs(gaussian.errors[-1]).max() < 0.02 < 0.05 < np.abs(lloyd.errors[-1, 1])
