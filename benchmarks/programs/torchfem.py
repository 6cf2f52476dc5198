"""torch-fem: a neo-Hookean body by automatic differentiation and its own Newton. Run once, see recorded.json."""

import time
from importlib.metadata import version

import numpy as np
import torch
from torchfem import Planar, Solid
from torchfem.materials import Hyperelastic3D, HyperelasticPlaneStress

from benchmarks.cases import Case
from benchmarks.programs.common import TOLERANCE, Run, main, run_of

torch.set_default_dtype(torch.float64)


def neo_hooke(F, params):
    """W = mu/2 (tr C - 3) - mu ln J + lam/2 (ln J)^2, as its documentation writes it."""
    lam, mu = params
    C = F.transpose(-1, -2) @ F
    log_J = 0.5 * torch.logdet(C)
    return mu / 2 * (torch.trace(C) - 3) - mu * log_J + lam / 2 * log_J**2


def solve(case: Case) -> Run:
    """Solve from no load to the full one; torch-fem cuts the step back where its Newton fails."""
    started = time.perf_counter()
    law = HyperelasticPlaneStress if case.dim == 2 else Hyperelastic3D
    nodes, elements = torch.tensor(case.nodes), torch.tensor(case.elements)
    body = (Planar if case.dim == 2 else Solid)(nodes, elements, law(neo_hooke, list(case.lame)))
    body.constraints = torch.tensor(case.held)
    body.forces = torch.tensor(case.force)
    atol = TOLERANCE * float(np.linalg.norm(case.force))
    displacement = body.solve(rtol=TOLERANCE, atol=atol, max_iter=20)[0]
    seconds = time.perf_counter() - started
    return run_of(case, version("torch-fem"), displacement.numpy(), 0, seconds)


if __name__ == "__main__":
    main(solve)
