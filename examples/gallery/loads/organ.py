"""
An organ from a label image
===========================

Each voxel of a segmented image becomes a cube of springs. The organ is held at one end,
and grasped and moved at the other; finite elements are solved on the same cubes.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt

import truespring as ts

# %%
# ``ts.new`` writes a commented study and its label image, as ``truespring new organ``
# does. Put your own image in its place; the study is read with two changes.
with TemporaryDirectory() as folder:
    file = ts.new("organ", Path(folder) / "organ.toml")
    study = ts.read_study(file, **{"mesh.edge": "6 mm", "solver.load_steps": 4})
    result = ts.verify(study, progress=False)

comparison = result.comparison
print(result.solutions["springs"].problem.mesh)
print(comparison)
print(result.verdict)
assert comparison.rms_error < 0.02

# %%
# Left the springs, coloured by their displacement; right by their distance from the
# finite elements.
fig, axes = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
springs, fem = result.solutions["springs"], result.solutions["neo-hookean"]
springs.plot(color="displacement", ax=axes[0])
springs.plot(over=fem, color="distance", ax=axes[1])
