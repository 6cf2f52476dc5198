"""The accessor `truespring` of PyVista's data sets: meshes and effective moduli of a grid.

PyVista 0.48 and newer imports this module at the first `grid.truespring`, by the entry point `pyvista.accessors`. With
an older installation of truespring: `import truespring.accessor`.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.errors import MeshError
from truespring.material import Material, PlaneStress, Section
from truespring.mesh import ELEMENT_KINDS, Mesh
from truespring.models import Moduli, Springs, moduli
from truespring.problem import Problem
from truespring.units import unit_of

if TYPE_CHECKING:
    import pyvista


# VTK's pixels and voxels, the cells of images: their corners in the order of quadrilaterals and hexahedra.
_PIXEL, _VOXEL = 8, 11
_ALONG_AXES: dict[int, Any] = {_PIXEL: [0, 1, 3, 2], _VOXEL: [0, 1, 3, 2, 4, 5, 7, 6]}


class Accessor:
    """What truespring makes of a grid of PyVista."""

    def __init__(self, grid: "pyvista.DataSet") -> None:
        """Take the grid."""
        self._grid = grid

    def mesh(self, unit: str | float = "m") -> Mesh:
        """Return the mesh of the cells of the highest dimension; `unit` is that of the grid's points.

        The z of a plane body is dropped. Raises MeshError if no cells are supported.
        """
        grid: Any = self._grid.cast_to_unstructured_grid()
        points = np.asarray(grid.points, dtype=float) * unit_of(unit, "length", "unit", MeshError)
        names = _cell_types()
        known = {
            names[int(kind)]: cells[:, _ALONG_AXES.get(int(kind), slice(None))]
            for kind, cells in grid.cells_dict.items()
            if int(kind) in names
        }
        dim = max((ELEMENT_KINDS[name].dim for name in known), default=0)
        cells = {name: own.astype(np.int64) for name, own in known.items() if ELEMENT_KINDS[name].dim == dim}
        if dim < len("xy"):
            raise MeshError(f"the grid has no cells of the kinds {', '.join(dict.fromkeys(names.values()))}")
        used = np.unique(np.concatenate([own.ravel() for own in cells.values()]))
        place = np.zeros(len(points), dtype=np.int64)
        place[used] = np.arange(len(used))
        return Mesh.of_kinds(points[used][:, :dim], {name: place[own] for name, own in cells.items()})

    def moduli(
        self,
        rule: str = "gaussian",
        young: float = 1.0,
        poisson: float = 0.3,
        section: Section | None = None,
        unit: str | float = "m",
        **parameters: Any,
    ) -> Moduli:
        """Return the effective moduli of springs on the grid, as `truespring.moduli` does.

        Args:
            rule: the stiffness rule; `parameters` are those of `Springs`.
            young, poisson: moduli of the material [Pa], [-].
            section: of a plane body, by default plane stress of thickness 1 m.
            unit: unit of the grid's points.
        """
        mesh = self.mesh(unit)
        chosen = PlaneStress(1.0) if section is None and mesh.dim == len("xy") else section
        return moduli(Problem(mesh, Material(young, poisson), chosen, stated=False), Springs(rule, **parameters))


def _cell_types() -> dict[int, str]:
    """Return the kind of element, a key of ELEMENT_KINDS, by the number of VTK's type of cell."""
    from pyvista import CellType

    names = {"tetra": "TETRA", "quad": "QUAD"}
    kinds = {name: kind.vtk for name, kind in ELEMENT_KINDS.items() if kind.dim > 1}
    found = {int(CellType[names.get(vtk, vtk.upper())]): name for name, vtk in kinds.items()}
    return {**found, _PIXEL: "quadrilateral", _VOXEL: "hexahedron"}


def _register() -> None:
    """Make the accessor known to PyVista."""
    import pyvista

    registered = [one.name for one in pyvista.registered_accessors() if one.target is pyvista.DataSet]
    if "truespring" not in registered:
        pyvista.register_dataset_accessor("truespring", pyvista.DataSet)(Accessor)


_register()
