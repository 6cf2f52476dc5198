"""The entries of the table: the models of the six methods."""

from collections.abc import Callable
from dataclasses import dataclass

from truespring.mesh import Box
from truespring.models import BemSprings, Fem, Heml, MassTensor, Model, Springs, Terzopoulos
from truespring.table1.bodies import DEPTH, LENGTH

#: The printed table of Lembryk and Ciszkiewicz: methods, criteria and signs.
METHODS = ("FEM", "Terzopoulos", "MSM", "HEML", "BEM + MSM", "mass-tensor")
CRITERIA = ("computational speed", "material properties", "results accuracy", "large deflection")
PRINTED = {
    "computational speed": ("+/-", "+", "+", "+", "+/-", "+/-"),
    "material properties": ("+", "-", "+/-", "+", "+", "+"),
    "results accuracy": ("+", "-", "+/-", "-", "+", "+"),
    "large deflection": ("+", "-", "+", "+/-", "-", "-"),
}


@dataclass(frozen=True)
class Entry:
    """A model in the table.

    Attributes:
        method: one of METHODS.
        name: name among the entries of the method.
        dims: dimensions in which it is measured.
        model: returns the model for a dimension and a Poisson's ratio.
        simplices: whether the elements are triangles and tetrahedra, else quadrilaterals and hexahedra.
        chief: whether its sign is compared with the printed sign of the method.
    """

    method: str
    name: str
    model: Callable[[int, float], Model]
    dims: tuple[int, ...] = (2, 3)
    simplices: bool = False
    chief: bool = False

    def element(self, dim: int) -> str:
        """Return the kind of elements."""
        if self.simplices:
            return "triangle" if dim == 2 else "tetrahedron"
        return "quadrilateral" if dim == 2 else "hexahedron"


def _half(dim: int) -> Box:
    """Return the clamped half of the body, the block of boundary elements."""
    far = (LENGTH / 2, *[DEPTH] * (dim - 1))
    return Box(tuple(-1.0 for _ in far), tuple(value + (0.0 if axis == 0 else 1.0) for axis, value in enumerate(far)))


def _lloyd(dim: int) -> Springs:
    """Return Lloyd's springs: 5/16 and 7/16 on squares; on cubes, which they did not treat, the least-squares fit."""
    return Springs(rule="lloyd") if dim == 2 else Springs(rule="least-squares")


ENTRIES: tuple[Entry, ...] = (
    Entry(
        "FEM", "squares, cubes; St. Venant-Kirchhoff", lambda d, nu: Fem("saint-venant-kirchhoff", "linear"), chief=True
    ),
    Entry("FEM", "squares, cubes; neo-Hookean", lambda d, nu: Fem("neo-hookean", "linear")),
    Entry("FEM", "squares, cubes; linear", lambda d, nu: Fem("linear", "linear")),
    Entry("Terzopoulos", "boundary of the paper", lambda d, nu: Terzopoulos("paper"), chief=True),
    Entry("Terzopoulos", "trapezoidal boundary", lambda d, nu: Terzopoulos("trapezoid")),
    Entry("MSM", "Lloyd; least squares on cubes", lambda d, nu: _lloyd(d), chief=True),
    Entry("MSM", "isotropic", lambda d, nu: Springs(rule="isotropic")),
    Entry("MSM", "isotropic with volume term", lambda d, nu: Springs(rule="isotropic", volume=True)),
    Entry("MSM", "Gaussian", lambda d, nu: Springs(rule="gaussian")),
    Entry(
        "MSM", "Gaussian of second order", lambda d, nu: Springs(rule="gaussian", element="quadratic"), simplices=True
    ),
    Entry("HEML", "squares, cubes; St. Venant-Kirchhoff", lambda d, nu: Heml("saint-venant-kirchhoff"), chief=True),
    Entry("HEML", "simplices; St. Venant-Kirchhoff", lambda d, nu: Heml("saint-venant-kirchhoff"), simplices=True),
    Entry("HEML", "simplices; neo-Hookean", lambda d, nu: Heml("neo-hookean"), simplices=True),
    Entry("BEM + MSM", "isotropic springs", lambda d, nu: BemSprings(block=_half(d), rule="isotropic"), chief=True),
    Entry(
        "BEM + MSM",
        "isotropic springs, corotated block",
        lambda d, nu: BemSprings(block=_half(d), rule="isotropic", corotated=True),
        dims=(2,),
    ),
    Entry("mass-tensor", "simplices; linear", lambda d, nu: MassTensor("linear"), simplices=True),
    Entry(
        "mass-tensor",
        "simplices; St. Venant-Kirchhoff",
        lambda d, nu: MassTensor("saint-venant-kirchhoff"),
        simplices=True,
        chief=True,
    ),
)
