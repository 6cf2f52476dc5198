"""Newton's method with mixed integration points: the same answers as line search, in few iterations, or a way back."""

import numpy as np
import pytest

import truespring as ts
from tests.closed_forms import material_of
from tests.test_examples import EXAMPLES
from truespring.study import read_study

WAYS = [("mixed", "multigrid"), ("line-search", "scipy"), ("line-search", "multigrid")]
SOFT, THIN = ts.Material(young=1e4, poisson=0.3), ts.PlaneStress(thickness=0.01)
MODELS = {
    "springs": ts.Springs(rule="isotropic"),
    "volume": ts.Springs(rule="isotropic", volume=True),
    "biquadratic": ts.Springs(rule="biquadratic"),
    "gaussian": ts.Springs(rule="gaussian"),
    **{law: ts.Fem(law=law) for law in ts.LAWS},
}


@pytest.mark.parametrize("name", ["bending", "stretching", "soft_block", "tissue"])
def test_every_way_leads_to_the_same_tip_of_a_shipped_study(name: str) -> None:
    study = read_study(EXAMPLES / f"{name}.toml")
    model = study.entries["biquadratic" if name == "tissue" else study.model]  # of the nodes of the mesh
    assert isinstance(model, ts.Springs)

    probe = study.probe if study.probe is not None else int(study.problem.loading.external_force.any(axis=1).argmax())

    def tip(method: str, linear: str) -> np.ndarray:
        path = ts.solve(study.problem, model, ts.Newton(load_steps=2, method=method, linear=linear))
        assert path.status is ts.Status.CONVERGED
        return path.states[-1].displacement[probe]

    wanted = tip("mixed", "scipy")
    for way in WAYS:
        assert np.linalg.norm(tip(*way) - wanted) <= 1e-8 * np.linalg.norm(wanted), way


@pytest.mark.parametrize("model", MODELS)
def test_one_step_to_half_the_length_takes_few_iterations(model: str) -> None:
    """As the line search finds it, which takes more of them; the linear law needs one."""
    mesh = ts.rectangle((8, 1), (64, 8))
    material = material_of(model if model in ts.LAWS else "linear", SOFT.young, SOFT.poisson)
    problem = ts.Problem(mesh, material, THIN, [ts.Fixed("left")], [ts.Force("right", (0, -0.24))])
    # Laws of rubber are stiff at the strains of the first iterate of one step.
    steps = 2 if model in ts.LAWS and ts.LAWS[model].constants else 1
    path = ts.solve(problem, MODELS[model], ts.Newton(load_steps=steps, tolerance=1e-8))
    searched = ts.solve(problem, MODELS[model], ts.Newton(load_steps=steps, tolerance=1e-8, method="line-search"))
    assert path.status is ts.Status.CONVERGED
    assert path.cost is not None and path.cost.newton == "mixed integration points" and not path.cost.notes
    tip = path.states[-1].displacement
    assert model == "linear" or 0.4 * 8 < np.abs(tip[:, 1]).max() < 0.6 * 8
    assert np.abs(tip - searched.states[-1].displacement).max() <= 1e-7 * np.abs(tip).max()
    assert path.newton_iterations <= 8 * steps
    assert path.newton_iterations < searched.newton_iterations or model == "linear"


@pytest.mark.parametrize(("kind", "poisson"), [("hexahedron", 0.45), ("hexahedron", 0.4999), ("tetrahedron", 0.49)])
def test_finite_elements_carry_the_pressure_apart(kind: str, poisson: float) -> None:
    """The number of iterations does not depend on Poisson's ratio: with the stress as a whole it was up to 243."""
    mesh = ts.box((0.16, 0.04, 0.04), (8, 2, 2), element=kind)
    loads = [ts.Force("right", (0.0, -0.2, 0.0))]
    problem = ts.Problem(mesh, ts.Material(10e3, poisson), supports=[ts.Fixed("left")], loads=loads)
    path = ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(load_steps=4, tolerance=1e-8))
    assert path.status is ts.Status.CONVERGED
    assert path.cost is not None and not path.cost.notes
    assert path.newton_iterations <= 18


def test_a_state_inside_out_is_searched_again_and_said() -> None:
    """A short bar under P L^2 / EI = 30 in one step: only mixed integration points invert an element."""
    mesh = ts.rectangle((10, 1), (40, 4))
    force = 30 * 1e4 * (0.01 / 12) / 10**2
    problem = ts.Problem(mesh, SOFT, THIN, [ts.Fixed("left")], [ts.Force("right", (0, -force))])
    once = {"load_steps": 1, "max_cutbacks": 0}
    alone, path, searched = (
        ts.solve(problem, MODELS["springs"], ts.Newton(**once, method=method))
        for method in ("mixed", "auto", "line-search")
    )
    assert alone.status is ts.Status.INVERTED
    assert path.status is searched.status is ts.Status.CONVERGED
    assert path.cost is not None
    (note,) = path.cost.notes
    assert "line search" in note and "load factor 1:" in note and "inverted" in note
    tip = searched.states[-1].displacement
    assert np.abs(path.states[-1].displacement - tip).max() <= 1e-8 * np.abs(tip).max()


def test_a_linear_body_takes_one_iteration_then_none() -> None:
    """From two states the third is extrapolated, of a linear body to where it is."""
    problem = ts.Problem(ts.rectangle((4.0, 1.0), (4, 1)), SOFT, THIN, ts.Fixed("left"), ts.Force("right", (0.0, 1e-3)))
    path = ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=3, method="mixed", max_iterations=1))
    assert path.status is ts.Status.CONVERGED
    assert [state.iterations for state in path.states] == [0, 1, 0, 0]
    assert path.cost is not None and path.cost.newton_iterations == 1
    assert path.cost.cg_iterations == path.cost.lanczos_iterations == 0 < path.cost.memory
