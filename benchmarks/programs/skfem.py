"""scikit-fem: the forms of St. Venant-Kirchhoff's law and a Newton written for it here, linear systems by MKL Pardiso."""

import time

import numpy as np
import pypardiso
import skfem
from skfem.helpers import ddot, eye, grad, identity, mul, trace, transpose

from benchmarks.cases import Case
from benchmarks.programs.common import TOLERANCE, Attempt, Run, in_few_increments, main, peak_bytes

# Its mesh and element, and which of VTK's corners its own are.
_KINDS = {
    2: (skfem.MeshQuad, skfem.ElementQuad1, slice(None)),
    3: (skfem.MeshHex, skfem.ElementHex1, [6, 2, 5, 7, 1, 3, 4, 0]),
}


def solve(case: Case) -> Run:
    """Solve in one load increment, or in as few more as it takes."""
    lam, mu = case.lame
    if case.dim == 2:  # plane stress
        lam = 2 * lam * mu / (lam + 2 * mu)

    def second_stress(strain):
        return lam * eye(trace(strain), case.dim) + 2 * mu * strain

    @skfem.BilinearForm
    def stiffness(u, v, w):
        F, S = w["F"], w["S"]
        strain_u, strain_v = (symmetric(mul(transpose(F), grad(field))) for field in (u, v))
        return ddot(second_stress(strain_u), strain_v) + ddot(mul(grad(u), S), grad(v))

    @skfem.LinearForm
    def internal(v, w):
        return ddot(mul(w["F"], w["S"]), grad(v))

    def attempt(increments: int) -> Attempt | None:
        started = time.perf_counter()
        mesh_class, element, order = _KINDS[case.dim]
        mesh = mesh_class(case.nodes.T.copy(), case.elements.T[order].copy())
        basis = skfem.Basis(mesh, skfem.ElementVector(element()), intorder=3)
        dofs = basis.nodal_dofs.T  # (n_nodes, dim)
        force, x = np.zeros(basis.N), np.zeros(basis.N)
        force[dofs] = case.force
        held = dofs[case.held]
        iterations = 0
        for increment in range(1, increments + 1):
            load = increment / increments * force
            for _ in range(30):
                gradient = grad(basis.interpolate(x))
                F = gradient + identity(gradient)
                S = second_stress((mul(transpose(F), F) - identity(F)) / 2)
                residual = load - internal.assemble(basis, F=F, S=S)
                residual[held] = 0.0
                if np.linalg.norm(residual) <= TOLERANCE * np.linalg.norm(load):
                    break
                tangent = stiffness.assemble(basis, F=F, S=S)
                x += skfem.solve(*skfem.condense(tangent, residual, D=held), solver=pardiso)
                iterations += 1
            else:
                return None
        return case.tip(x[dofs]), iterations, time.perf_counter() - started

    tip, iterations, seconds, notes = in_few_increments(attempt)
    return Run(skfem.__version__, seconds, tip, iterations, peak_bytes(), notes=notes)


def pardiso(matrix, right):
    """Solve a linear system, in the form that scikit-fem asks for."""
    return pypardiso.spsolve(matrix.tocsr(), right)


def symmetric(tensor):
    """The symmetric part."""
    return (tensor + transpose(tensor)) / 2


if __name__ == "__main__":
    main(solve)
