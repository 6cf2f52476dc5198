"""The study truss.toml in Python: a shallow truss of two bars, loaded beyond both limit points."""

import numpy as np

import truespring as ts


def main() -> ts.Solution:
    nodes = np.array([[-1.0, 0.0], [0.0, 0.2], [1.0, 0.0]])
    network = ts.SpringNetwork(nodes, springs=[[0, 1], [1, 2]], stiffness=[1000 / np.hypot(1.0, 0.2)] * 2)
    problem = ts.Problem(network.mesh, supports=ts.Fixed(on=[0, 2]), loads=ts.Force(on=[1], total=(0.0, -4.0)))
    solution = ts.solve(problem, network, ts.DisplacementControl(on=[1], direction="y", to=-0.45, steps=18))
    for state in solution.states:
        if state.critical:
            print(f"{state.critical}: {4 * state.load_factor:.4f} N at {-1e3 * state.displacement[1, 1]:.2f} mm")
    return solution


if __name__ == "__main__":
    main()
