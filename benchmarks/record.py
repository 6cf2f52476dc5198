"""Measure the programs that are too slow for each run: python -m benchmarks.record PYTHON.

PYTHON is an interpreter with torch-fem, pypardiso and JAX. Writes recorded.json, which the page shows.
"""

import json
import sys

from benchmarks import machine
from benchmarks.runs import HERE, Job, on_case

# Module, label, material law, dimension, elements over the height.
_RECORDED = (
    ("torchfem", "torch-fem", "neo-Hookean, load steps chosen by the program", 2, 12),
    ("torchfem", "torch-fem", "neo-Hookean, load steps chosen by the program", 3, 6),
    ("jax_springs", "JAX with SciPy's L-BFGS", "the springs of Lloyd's rule", 2, 12),
    ("jax_springs", "JAX with SciPy's L-BFGS", "the springs of Lloyd's rule", 2, 25),
)


def main() -> None:
    """Run each program once and write the results."""
    runs = []
    for module, label, matter, dim, depth in _RECORDED:
        job = Job("gaussian", dim, "bending", depth)  # the same mesh and force
        found = on_case(f"programs.{module}", job, (), sys.argv[1])
        if "failure" in found:
            raise SystemExit(f"{label}: {found['failure']}")
        notes = ", ".join(part for part in (matter, found.pop("notes")) if part)
        del found["samples"]
        runs.append({"program": label, "dim": dim, "n_nodes": job.n_nodes, "notes": notes, **found})
    recorded = {"date": machine.today(), **machine.hardware(), "runs": runs}
    (HERE / "recorded.json").write_text(json.dumps(recorded, indent=1) + "\n")


if __name__ == "__main__":
    main()
