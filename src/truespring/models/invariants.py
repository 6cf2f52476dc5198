"""Laws as functions W(I1, ln J) of the trace of C and of the volume ratio, for finite elements and Gaussian springs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.models.constants import Constants, Response
from truespring.models.elasticity_parts import Elasticity, of_tensor
from truespring.models.symmetric import determinant, dimensions, identity, inverted, outer, trace
from truespring.models.thickness import Slope, free_thickness


@dataclass(frozen=True, slots=True)
class Derivatives:
    """An energy density [J/m^3] and its derivatives by I1, the trace of C in space, and y = ln J.

    All are of one shape, or of shapes that broadcast to that of the energy.
    """

    energy: Floats
    by_trace: Floats
    by_y: Floats
    by_trace_trace: Floats
    by_trace_y: Floats
    by_y_y: Floats

    @property
    def filled(self) -> "Derivatives":
        """The same with all arrays of the shape of the energy, some of them read-only."""
        parts = (self.by_trace, self.by_y, self.by_trace_trace, self.by_trace_y, self.by_y_y)
        return Derivatives(self.energy, *(np.broadcast_to(part, self.energy.shape) for part in parts))

    @property
    def linear(self) -> bool:
        """Whether the energy is linear in I1, with a factor that does not depend on ln J."""
        return not (np.any(self.by_trace_trace) or np.any(self.by_trace_y))


#: A law: returns the derivatives at I1 [-] and y = ln J [-], with the constants of the elements.
InvariantLaw = Callable[[Floats, Floats, Constants], Derivatives]


@dataclass(frozen=True, slots=True)
class Condensed:
    """A law in the space of the mesh: derivatives by I1 and y of the plane, without the third direction.

    Attributes:
        at: energy density and derivatives; energy and derivatives are NaN outside the domain of the law.
        C_33: square of the stretch of the third direction [-]; 1 in plane strain and in 3D.
        across: Kirchhoff stress of the third direction [Pa]; zero in plane stress.
    """

    at: Derivatives
    C_33: Floats
    across: Floats

    @property
    def filled(self) -> "Condensed":
        """The same with all derivatives of the shape of the energy, some of them read-only."""
        return Condensed(self.at.filled, self.C_33, self.across)


def condensed(law: InvariantLaw, trace_C: Floats, y: Floats, dim: int, constants: Constants) -> Condensed:
    """Return a law at the trace of C and ln J of a body of dimension `dim`, in 2D of the plane.

    In plane strain and in 3D, C_33 is 1. In plane stress, C_33 minimises the energy: Newton's method in z = ln C_33 on
    C_33 W_I1 + W_y / 2 = 0; the second derivatives are those of the minimum.
    """
    if not constants.plane_stress:
        found = law(trace_C if dim == 3 else trace_C + 1, y, constants)
        return Condensed(found, np.ones_like(y), 2 * found.by_trace + found.by_y)
    z = _free_thickness(law, trace_C, y, constants)
    C_33 = np.exp(z)
    found = law(trace_C + C_33, y + z / 2, constants)
    by_z_trace = C_33 * found.by_trace_trace + found.by_trace_y / 2
    by_z_y = C_33 * found.by_trace_y + found.by_y_y / 2
    by_z_z = C_33 * found.by_trace + C_33 * by_z_trace + by_z_y / 2
    minimum = Derivatives(
        found.energy,
        found.by_trace,
        found.by_y,
        found.by_trace_trace - by_z_trace**2 / by_z_z,
        found.by_trace_y - by_z_trace * by_z_y / by_z_z,
        found.by_y_y - by_z_y**2 / by_z_z,
    )
    return Condensed(minimum, C_33, 2 * C_33 * found.by_trace + found.by_y)


def _free_thickness(law: InvariantLaw, trace_C: Floats, y: Floats, constants: Constants) -> Floats:
    """Return ln C_33 at which the stress of the third direction is zero; NaN where there is no stable one."""

    def slope(z: Floats) -> Slope:
        C_33 = np.exp(z)
        found = law(trace_C + C_33, y + z / 2, constants)
        pull = C_33 * found.by_trace
        curvature = pull + found.by_y_y / 4
        if not found.linear:
            curvature += C_33 * (C_33 * found.by_trace_trace + found.by_trace_y)
        return Slope(pull + found.by_y / 2, curvature)

    def of_the_plane() -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):  # of an element that is a point there is none
            return np.log(trace_C / 2)

    lam, mu = constants.lam, constants.mu
    start = np.clip(-2 * lam / (lam + 2 * mu) * y, -50.0, 50.0)
    return free_thickness(slope, start, of_the_plane, mu)


def by_invariants(law: InvariantLaw, current: bool = False) -> Callable[[Floats, Constants], Response]:
    """Return the response of a law as a function of C, axes (component, ...), and constants, for LAWS.

    S = 2 W_I1 I + W_y C^-1, and its derivative by E = (C - I) / 2. With `current`, the response is in current axes, a
    function of b: the same with b instead of I and I instead of C^-1.
    """

    def respond(strain: Floats, constants: Constants) -> Response:
        dim, eye = dimensions(strain), identity(strain)
        with np.errstate(divide="ignore", invalid="ignore"):
            y = np.log(determinant(strain)) / 2
        found = condensed(law, trace(strain), y, dim, constants)
        at = found.at
        stress = 2 * at.by_trace * (strain if current else eye)
        inverse = eye if current else inverted(strain)
        stress = stress + at.by_y * inverse

        def elasticity() -> Elasticity:
            if current:
                if at.linear:
                    return Elasticity(at.by_y_y, -at.by_y)
                rest = 4 * at.by_trace_trace * outer(strain, strain)
                return Elasticity(at.by_y_y, -at.by_y, 2 * at.by_trace_y * strain, rest)
            found = of_tensor(at.by_y_y, -at.by_y, inverse)
            if at.linear:
                return found
            return found.plus(Elasticity(4 * at.by_trace_trace, 0.0, 2 * at.by_trace_y * inverse))

        energy = np.where(np.isfinite(at.energy), at.energy, np.inf)
        return Response(energy, stress, elasticity, np.sqrt(found.C_33), found.across)

    return respond


#: The energy of a change of shape: returns psi [J/m^3] and its first and second derivative at I1b [-].
ShapeEnergy = Callable[[Floats], tuple[Floats, Floats, Floats]]


def isochoric(I1: Floats, y: Floats, psi: ShapeEnergy, bulk: float | Floats) -> Derivatives:
    """Return the derivatives of psi(I1b) + bulk/2 y^2, I1b = I1 exp(-2 y / 3) the trace of C without dilatation."""
    shrunk = np.exp(-2 * y / 3)
    I1b = I1 * shrunk
    energy, first, second = psi(I1b)
    return Derivatives(
        energy + bulk / 2 * y**2,
        first * shrunk,
        -2 / 3 * I1b * first + bulk * y,
        second * shrunk**2,
        -2 / 3 * shrunk * (first + I1b * second),
        4 / 9 * I1b * (first + I1b * second) + bulk,
    )
