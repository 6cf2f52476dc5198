"""The accessor `truespring` of PyVista's data sets: meshes and effective moduli of a grid.

PyVista 0.48 and newer imports this module at the first `grid.truespring`, by the entry point `pyvista.accessors`. With
an older installation of truespring: `import truespring.accessor`.
"""

from typing import TYPE_CHECKING, Any

from truespring.material import Material, PlaneStress, Section
from truespring.mesh import Mesh
from truespring.models import Moduli, Springs, moduli
from truespring.problem import Problem

if TYPE_CHECKING:
    import pyvista


class Accessor:
    """What truespring makes of a grid of PyVista."""

    def __init__(self, grid: "pyvista.DataSet") -> None:
        """Take the grid."""
        self._grid = grid

    def mesh(self, unit: str | float = "m") -> Mesh:
        """Return the mesh of the grid with its groups, see `Mesh.from_pyvista`; `unit` is that of the grid's points."""
        return Mesh.from_pyvista(self._grid, unit)

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


def _register() -> None:
    """Make the accessor known to PyVista."""
    import pyvista

    registered = [one.name for one in pyvista.registered_accessors() if one.target is pyvista.DataSet]
    if "truespring" not in registered:
        pyvista.register_dataset_accessor("truespring", pyvista.DataSet)(Accessor)


_register()
