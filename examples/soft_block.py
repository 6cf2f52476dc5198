"""The study soft_block.toml in Python: a nearly incompressible block, springs with a volume term compared with FEM."""

import truespring as ts


def main() -> dict[str, ts.Comparison]:
    problem = ts.Problem(
        mesh=ts.box(size=(0.16, 0.04, 0.04), elements=(20, 5, 5)),
        material=ts.Material(young=10e3, poisson=0.45),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.2, 0.0))],
    )
    newton = ts.Newton(load_steps=5)
    springs = ts.solve(problem, ts.Springs(rule="isotropic", volume=True), newton)
    comparisons = {
        law: ts.compare(springs, ts.solve(problem, ts.Fem(law=law), newton), probe="right-middle")
        for law in ("linear", "neo-hookean")
    }
    print(springs.moduli)
    for comparison in comparisons.values():
        print(comparison)
    return comparisons


if __name__ == "__main__":
    main()
