"""The study organ.toml in Python: a liver from a label image, held at one end and grasped at the other."""

import truespring as ts


def main() -> dict[str, ts.Comparison]:
    held = ts.Box((0.030, 0.056, 0.005), (0.060, 0.061, 0.040))
    grasped = ts.Box((0.030, 0.030, 0.005), (0.060, 0.034, 0.040))
    problem = ts.Problem(
        mesh=ts.read_voxels("pyvista:frog_tissues", label=10, edge=0.626e-3, unit="0.2 mm"),
        material=ts.Material(young=3e3, poisson=0.45, density=1060.0),
        supports=[ts.Fixed(on=held), ts.Fixed(on=grasped, displacement=(0.003, -0.006, 0.0))],
        loads=ts.Gravity((0.0, -9.81, 0.0)),
    )
    newton = ts.Newton(load_steps=5, tolerance=1e-8)
    gaussian = ts.solve(problem, ts.Springs(rule="gaussian"), newton)
    references = {
        "springs": ts.Springs(rule="isotropic", volume=True),
        "linear": ts.Fem(law="linear"),
        "neo-hookean": ts.Fem(law="neo-hookean"),
    }
    comparisons = {name: ts.compare(gaussian, ts.solve(problem, model, newton)) for name, model in references.items()}
    for comparison in comparisons.values():
        print(comparison)
    return comparisons


if __name__ == "__main__":
    main()
