"""The study muscle.toml in Python: a strip of muscle lifts a weight by its tendon, Gaussian springs beside FEM."""

import math

import truespring as ts


def main() -> dict[str, ts.Comparison]:
    pennate = (math.cos(math.radians(15)), math.sin(math.radians(15)))
    tendon = ts.Material(young=30e3, poisson=0.45, fibres=ts.Fibres(along=(1, 0), k1=250e3, k2=5))
    problem = ts.Problem(
        mesh=ts.rectangle(size=(0.08, 0.016), elements=(20, 4)),
        material=ts.Material(young=15e3, poisson=0.45, fibres=ts.Fibres(along=pennate, k1=4e3, k2=2)),
        section=ts.PlaneStress(thickness=0.005),
        regions=[ts.Region(on=ts.Box((0.06, 0.0), (0.08, 0.016)), material=tendon)],
        supports=[ts.Fixed(on="left")],
        loads=[
            ts.ActiveTension(tension=8e3, on=ts.Box((0.0, 0.0), (0.06, 0.016))),
            ts.Force(on="right", total=(0.2, 0.0)),
        ],
    )
    newton = ts.Newton(load_steps=5)
    springs = ts.solve(problem, ts.Springs(rule="gaussian"), newton)
    reference = ts.solve(problem, ts.Fem(law="neo-hookean"), newton)
    comparison = ts.compare(springs, reference, probe="right-middle")
    print(comparison)
    return {"neo-hookean": comparison}


if __name__ == "__main__":
    main()
