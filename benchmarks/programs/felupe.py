"""FElupe: a neo-Hookean solid body, its own Newton, linear systems by MKL Pardiso as it advises."""

import time

import felupe as fem
import numpy as np
import pypardiso
from felupe.math import cdya_ik, cdya_il, det, dya, identity, inv, transpose
from scipy.special import wrightomega

from benchmarks.cases import Case
from benchmarks.programs.common import TOLERANCE, Attempt, Run, in_few_increments, main, peak_bytes


class PlaneStressNeoHooke(fem.ConstitutiveMaterial):
    """The law of fem.NeoHookeCompressible, free of stress across the plane; evaluated in chunks of cells by threads.

    There mu (C_33 - 1) + lam ln J = 0; eliminated, it turns lam into lam 2 mu C_33 / (2 mu C_33 + lam) in the tangent.
    """

    def __init__(self, mu, lmbda):
        self.mu, self.lmbda, self.parallel = mu, lmbda, True
        self.x = [np.eye(2), np.zeros(0)]

    def _across(self, J):
        """C_33 and ln J in three dimensions from the J of the plane."""
        half = self.lmbda / (2 * self.mu)
        C_33 = half * wrightomega(1 / half - 2 * np.log(J) - np.log(half))
        return C_33, np.log(J) + np.log(C_33) / 2

    def _gradient(self, x):
        F, statevars = x[0], x[-1]
        J = det(F)
        iFT = transpose(inv(F, J))
        return [self.mu * (F - iFT) + self.lmbda * self._across(J)[1] * iFT, statevars]

    def _hessian(self, x):
        F = x[0]
        J = det(F)
        iFT, unit = transpose(inv(F, J)), identity(F)
        C_33, log_J = self._across(J)
        lmbda = self.lmbda * 2 * self.mu * C_33 / (2 * self.mu * C_33 + self.lmbda)
        turned = (self.mu - self.lmbda * log_J) * cdya_il(iFT, iFT)
        return [self.mu * cdya_ik(unit, unit) + turned + lmbda * dya(iFT, iFT)]


def material(case: Case):
    """Return FElupe's own law in space, and what it is in plane stress."""
    lam, mu = case.lame
    return PlaneStressNeoHooke(mu, lam) if case.dim == 2 else fem.NeoHookeCompressible(mu, lam, parallel=True)


def solve(case: Case) -> Run:
    """Solve in one load increment, or in as few more as it takes."""

    def attempt(increments: int) -> Attempt | None:
        started = time.perf_counter()
        mesh = fem.Mesh(case.nodes, case.elements, {2: "quad", 3: "hexahedron"}[case.dim])
        region = {2: fem.RegionQuad, 3: fem.RegionHexahedron}[case.dim](mesh)
        field = fem.FieldContainer([fem.Field(region, dim=case.dim)])
        supports = {"fixed": fem.Boundary(field[0], fx=0.0)}
        dof0, dof1 = fem.dof.partition(field, supports)
        solid = fem.SolidBody(material(case), field)
        loaded = np.flatnonzero(case.force.any(axis=1))
        load = fem.PointLoad(field, loaded)
        iterations = 0
        try:
            for increment in range(1, increments + 1):
                load.update(increment / increments * case.force[loaded])
                found = fem.newtonraphson(
                    items=[solid, load],
                    dof0=dof0,
                    dof1=dof1,
                    kwargs={"parallel": True},
                    solver=pypardiso.spsolve,
                    tol=TOLERANCE,
                    maxiter=30,
                    verbose=False,
                )
                iterations += found.iterations
        except fem.NewtonConvergenceError:
            return None
        return case.tip(field[0].values), iterations, time.perf_counter() - started

    tip, iterations, seconds, notes = in_few_increments(attempt)
    return Run(fem.__version__, seconds, tip, iterations, peak_bytes(), notes=notes)


if __name__ == "__main__":
    main(solve)
