"""The study soft_block.toml in Python: a nearly incompressible block, Gaussian springs compared with FEM."""

import truespring as ts


def main() -> dict[str, ts.Comparison]:
    problem = ts.Problem(
        mesh=ts.box(size=(0.16, 0.04, 0.04), elements=(20, 5, 5)),
        material=ts.Material(young=10e3, poisson=0.45),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.2, 0.0))],
    )
    newton = ts.Newton(load_steps=5)
    gaussian = ts.solve(problem, ts.Springs(rule="gaussian"), newton)
    references = {
        "springs": ts.Springs(rule="isotropic", volume=True),
        "linear": ts.Fem(law="linear"),
        "neo-hookean": ts.Fem(law="neo-hookean"),
    }
    comparisons = {
        name: ts.compare(gaussian, ts.solve(problem, model, newton), probe="right-middle")
        for name, model in references.items()
    }
    print(gaussian.moduli)
    for comparison in comparisons.values():
        print(comparison)
    return comparisons


if __name__ == "__main__":
    main()
