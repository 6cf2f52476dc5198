"""
Compare with a result of CalculiX
=================================

CalculiX bent a block of rubber. Springs are solved on its mesh, and compared with its
result file node by node.
"""

import matplotlib.pyplot as plt
import numpy as np

import truespring as ts

# %%
# The input of CalculiX, :download:`block.inp`, and its output by ``ccx block``,
# :download:`block.frd`, lie beside this script, in millimetres and newtons.
mesh = ts.read_mesh("block.inp", unit="mm")
calculix = ts.read_result("block.frd", unit="mm")
print(calculix, "with the node sets", sorted(mesh.node_groups))


def bent(mesh, clamped, end):
    return ts.Problem(
        mesh,
        ts.Material(young=1e5, poisson=0.3),
        supports=ts.Fixed(clamped),
        loads=ts.Force(end, (0.0, -0.12, 0.0)),
    )


newton = ts.Newton(load_steps=4)
springs = ts.solve(bent(mesh, "CLAMPED", "END"), ts.Springs(rule="gaussian"), newton)

# %%
# The material of the deck, ``*ELASTIC`` with ``NLGEOM``, is that of St. Venant and
# Kirchhoff. Its incompatible elements (C3D8I) bend well. Tetrahedra of second order
# have other nodes: the result of CalculiX is interpolated on them.
tetrahedra = ts.box((0.10, 0.02, 0.02), (10, 2, 2), "tetrahedron")
fem = ts.solve(
    bent(tetrahedra, "left", "right"), ts.Fem(law="saint-venant-kirchhoff"), newton
)
for solution in (springs, fem):
    print(ts.compare(solution, calculix))

tip = ts.named_point(mesh, "right-middle")
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
for solution, mark in ((calculix, "k-"), (springs, "o"), (fem, "x")):
    node = np.linalg.norm(
        solution.problem.mesh.nodes - mesh.nodes[tip], axis=1
    ).argmin()
    down = [-1e3 * state.displacement[node, 1] for state in solution.states]
    ax.plot(down, 120 * solution.load_factors, mark, label=solution.label)
ax.set(xlabel="deflection [mm]", ylabel="force [mN]", title="A block of rubber, bent")
ax.legend()
assert ts.compare(fem, calculix).rms_error < 0.01
assert ts.compare(springs, calculix).rms_error < 0.05

# %%
# The springs, coloured by their distance from the result of CalculiX.
springs.plot(over=calculix, color="distance")
# sphinx_gallery_thumbnail_number = -1
