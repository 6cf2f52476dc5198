"""The study tissue.toml in Python: a mesh from a file, Gaussian springs of second order compared with FEM."""

from pathlib import Path

import truespring as ts


def main() -> dict[str, ts.Comparison]:
    problem = ts.Problem(
        mesh=ts.read_mesh(Path(__file__).parent / "tissue.msh", unit="mm"),
        material=ts.Material(young=5e3, poisson=0.4),
        supports=[ts.Fixed(on="clamped")],
        loads=[ts.Force(on="grasped", total=(0.1, 0.0, 0.2))],
    )
    newton = ts.Newton(load_steps=5)
    gaussian = ts.solve(problem, ts.Springs(rule="gaussian", element="quadratic"), newton)
    models = {
        "biquadratic": ts.Springs(rule="biquadratic"),
        "lloyd": ts.Springs(rule="lloyd"),
        "saint-venant-kirchhoff": ts.Fem(law="saint-venant-kirchhoff", element="linear"),
        "neo-hookean": ts.Fem(law="neo-hookean"),
    }
    comparisons = {name: ts.compare(gaussian, ts.solve(problem, model, newton)) for name, model in models.items()}
    for comparison in comparisons.values():
        print(comparison)
    return comparisons


if __name__ == "__main__":
    main()
