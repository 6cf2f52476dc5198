"""One module a program: `python -m benchmarks.programs.NAME CASE.npz` prints one line of JSON."""
