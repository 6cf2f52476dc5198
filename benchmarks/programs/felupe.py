"""FElupe: a solid body and its own Newton, linear systems by MKL Pardiso as it advises."""

import sys
import time
from functools import partial

import felupe as fem
import numpy as np
import pypardiso
from felupe.math import cdya_ik, cdya_il, det, dot, dya, identity, inv, trace, transpose

from benchmarks.cases import Case, serendipity
from benchmarks.programs.common import TOLERANCE, Attempt, Run, in_few_increments, main
from benchmarks.programs.neo_hooke import settled


class OnThreads(fem.ConstitutiveMaterial):
    """A law of two Lamé constants that is evaluated in chunks of cells by threads, as FElupe's own are."""

    parallel = True

    def __init__(self, lam: float, mu: float, dim: int) -> None:
        self.lam, self.mu = lam, mu
        self.x = [np.eye(dim), np.zeros(0)]


class PlaneStressNeoHooke(OnThreads):
    """The law of fem.NeoHookeCompressible, free of stress across the plane."""

    def _gradient(self, x):
        F, statevars = x[0], x[-1]
        J = det(F)
        iFT = transpose(inv(F, J))
        return [self.mu * (F - iFT) + self.lam * settled(J, self.lam, self.mu)[0] * iFT, statevars]

    def _hessian(self, x):
        F = x[0]
        J = det(F)
        iFT, unit = transpose(inv(F, J)), identity(F)
        log_J, lam = settled(J, self.lam, self.mu)
        turned = (self.mu - self.lam * log_J) * cdya_il(iFT, iFT)
        return [self.mu * cdya_ik(unit, unit) + turned + lam * dya(iFT, iFT)]


class SaintVenantKirchhoff(OnThreads):
    """P = F S with S = lam tr E + 2 mu E."""

    def _gradient(self, x):
        F, statevars = x[0], x[-1]
        return [dot(F, self._second_stress(F)), statevars]

    def _hessian(self, x):
        F = x[0]
        unit, left = identity(F), dot(F, transpose(F))
        material = self.lam * dya(F, F) + self.mu * (cdya_ik(left, unit) + cdya_il(F, F))
        return [material + cdya_ik(unit, self._second_stress(F))]

    def _second_stress(self, F):
        strain = (dot(transpose(F), F) - identity(F)) / 2
        return self.lam * trace(strain) * identity(F) + 2 * self.mu * strain


def material(case: Case, law: str) -> fem.ConstitutiveMaterial:
    """Return FElupe's own law where it has it: neo-Hookean in space."""
    lam, mu = case.lame
    if law == "saint-venant-kirchhoff":
        return SaintVenantKirchhoff(case.lam_within, mu, case.dim)
    return PlaneStressNeoHooke(lam, mu, 2) if case.dim == 2 else fem.NeoHookeCompressible(mu, lam, parallel=True)


#: FElupe's cell type and region of each of its elements, by dimension and name.
ELEMENTS = {
    (2, "linear"): ("quad", fem.RegionQuad),
    (3, "linear"): ("hexahedron", fem.RegionHexahedron),
    (3, "three-field"): ("hexahedron", fem.RegionHexahedron),
    (3, "quadratic"): ("hexahedron20", fem.RegionQuadraticHexahedron),
}


def solve(case: Case, law: str, element: str) -> Run:
    """Solve in one load increment, or in as few more as it takes.

    Elements "three-field" have a constant pressure and volume ratio each, which do not lock; "quadratic" 20 nodes.
    """
    kind, region_of = ELEMENTS[case.dim, element]
    case = serendipity(case) if element == "quadratic" else case
    matter = material(case, law)
    matter = fem.ThreeFieldVariation(matter, parallel=True) if element == "three-field" else matter

    def attempt(increments: int) -> Attempt | None:
        started = time.perf_counter()
        region = region_of(fem.Mesh(case.nodes, case.elements, kind))
        if element == "three-field":
            field = fem.FieldsMixed(region, n=3)
        else:
            field = fem.FieldContainer([fem.Field(region, dim=case.dim)])
        dof0, dof1 = fem.dof.partition(field, {"fixed": fem.Boundary(field[0], fx=0.0)})
        solid = fem.SolidBody(matter, field)
        loaded = np.flatnonzero(case.force.any(axis=1))
        load = fem.PointLoad(field, loaded)
        iterations = 0
        for increment in range(1, increments + 1):
            load.update(increment / increments * case.force[loaded])
            try:
                found = fem.newtonraphson(
                    items=[solid, load],
                    dof0=dof0,
                    dof1=dof1,
                    kwargs={"parallel": True},
                    solver=pypardiso.spsolve,
                    tol=TOLERANCE,
                    maxiter=20,
                    verbose=False,
                )
            except fem.NewtonConvergenceError:
                return None
            iterations += found.iterations
        return field[0].values, iterations, time.perf_counter() - started

    with np.errstate(invalid="ignore"):  # elements that Newton turns inside out on its way
        return in_few_increments(case, fem.__version__, attempt)


if __name__ == "__main__":
    main(partial(solve, law=sys.argv[2], element=sys.argv[3]))
