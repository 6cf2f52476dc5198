"""The study stretching.toml in Python: a soft body under a nominal stress of 0.30 E, springs compared with FEM."""

import truespring as ts

E, t, L, H = 10e3, 0.010, 0.160, 0.040

problem = ts.Problem(
    mesh=ts.rectangle(size=(L, H), elements=(16, 4)),
    material=ts.Material(young=E, poisson=1 / 3),
    section=ts.PlaneStress(thickness=t),
    supports=[ts.Fixed(on="left")],
    loads=[ts.Force(on="right", total=(0.30 * E * t * H, 0.0))],
)
models = {
    "linear": ts.Fem(law="linear"),
    "nonlinear": ts.Fem(law="saint-venant-kirchhoff"),
    "neo-hookean": ts.Fem(law="neo-hookean"),
    "hencky": ts.Fem(law="hencky"),
}


def main() -> dict[str, ts.Comparison]:
    newton = ts.Newton(load_steps=10)
    springs = ts.solve(problem, ts.Springs(rule="lloyd"), newton)
    return {
        name: ts.compare(springs, ts.solve(problem, model, newton), probe="right-middle")
        for name, model in models.items()
    }


if __name__ == "__main__":
    for name, comparison in main().items():
        print(f"{name}: {comparison}")
