"""Show and write values: what `solution.plot()`, `solution.write()` or `mesh.to_pyvista()` do.

Methods of values import a module of this package inside the method, and do nothing else: see `tests/test_house.py`.
"""
