"""scikit-fem: the forms of the neo-Hookean law and a Newton written for it here, linear systems by MKL Pardiso."""

import time

import numpy as np
import pypardiso
import skfem
from skfem.helpers import ddot, det, grad, identity, inv, mul, trace, transpose

from benchmarks.cases import Case
from benchmarks.programs.common import TOLERANCE, Attempt, Run, in_few_increments, main
from benchmarks.programs.neo_hooke import settled

# Its mesh and element, and which of VTK's corners its own are.
_KINDS = {
    2: (skfem.MeshQuad, skfem.ElementQuad1, slice(None)),
    3: (skfem.MeshHex, skfem.ElementHex1, [6, 2, 5, 7, 1, 3, 4, 0]),
}


def solve(case: Case) -> Run:
    """Solve in one load increment, or in as few more as it takes."""
    lam, mu = case.lame

    @skfem.BilinearForm
    def stiffness(u, v, w):
        left, right = mul(w["inverse"], grad(u)), mul(w["inverse"], grad(v))
        turned = (mu - lam * w["log_J"]) * ddot(left, transpose(right))
        return mu * ddot(grad(u), grad(v)) + turned + w["lam"] * trace(left) * trace(right)

    @skfem.LinearForm
    def internal(v, w):
        return ddot(mu * w["F"] + (lam * w["log_J"] - mu) * transpose(w["inverse"]), grad(v))

    def fields(basis, x):
        gradient = grad(basis.interpolate(x))
        F = gradient + identity(gradient)
        J = det(F)
        log_J, tangent_lam = settled(J, lam, mu) if case.dim == 2 else (np.log(J), np.full_like(J, lam))
        return {"F": F, "inverse": inv(F), "log_J": log_J, "lam": tangent_lam}

    def attempt(increments: int) -> Attempt | None:
        started = time.perf_counter()
        mesh_class, element, order = _KINDS[case.dim]
        mesh = mesh_class(case.nodes.T.copy(), case.elements.T[order].copy())
        basis = skfem.Basis(mesh, skfem.ElementVector(element()), intorder=3)
        dofs = basis.nodal_dofs.T
        force, x = np.zeros(basis.N), np.zeros(basis.N)
        force[dofs] = case.force
        held = dofs[case.held]
        iterations = 0
        for increment in range(1, increments + 1):
            load = increment / increments * force
            for _ in range(20):
                state = fields(basis, x)
                residual = load - internal.assemble(basis, **state)
                residual[held] = 0.0
                if not np.isfinite(residual).all():
                    return None
                if np.linalg.norm(residual) <= TOLERANCE * np.linalg.norm(load):
                    break
                tangent = stiffness.assemble(basis, **state)
                x += skfem.solve(*skfem.condense(tangent, residual, D=held), solver=pardiso)
                iterations += 1
            else:
                return None
        return x[dofs], iterations, time.perf_counter() - started

    with np.errstate(invalid="ignore"):  # elements that Newton turns inside out on its way
        return in_few_increments(case, skfem.__version__, attempt)


def pardiso(matrix, right):
    """Solve a linear system, in the form that scikit-fem asks for."""
    return pypardiso.spsolve(matrix.tocsr(), right)


if __name__ == "__main__":
    main(solve)
