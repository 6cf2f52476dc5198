"""Compile kernels in a second process, while the first one imports the library and reads the study.

`python -m truespring.kernels.ahead DIM` compiles the kernels in SIGNATURES for bodies of a dimension into the cache on
disk, where the first process finds them. It ends with the process that started it.
"""

import importlib
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from truespring.kernels.threads import n_threads

#: Kernels of small bodies of springs and finite elements, with the types of their arguments, in the order in which the
#: second process compiles them. Meanwhile the first one compiles those that it needs: the last two of the table, then
#: others from the end of the table, so that both rarely compile the same kernel.
#: Arrays: f float64, i int32, l int64, b bool, read-only as a capital, with the number of axes. Numbers: n int64, q
#: bool. Tuples of zeros: z of length dim, zz of length dim^2.
SIGNATURES = {
    "elements.stiffnesses": "n n f2 q f2 f2 f2 f2 f2 l2 f3 f2 f2 f2 f3 z zz",
    "gaussian.rows": "n n i1 i1 i3 i1 f1 f2 i2 i1 i1 f1 f3 f3 f1 f4 l1 f2 f3 z",
    "sparsity.incidence": "i2 n",
    "sparsity.fill_neighbours": "n n i2 i1 i1 i1 i1",
    "elements.congruences": "n n f2 f2 q l2 f2 z",
    "elements.strain_changes": "n n f2 l2 f3 f2 q l2 f2 z",
    "sparsity.add_pairs": "n n i2 i3 f3 n n f3 z",
    "sparsity.add_rows": "n n i1 i1 f2 f2",
    "elements.forces": "n n f2 q f2 l2 f3 f2 f2 z",
    "gaussian.growths": "n n f2 i2 f3 f2 z",
    "gaussian.add_forces": "n n i1 i1 f3 f2 f2 z",
    "gaussian.pulls": "n n f2 i1 i1 f1 f2 z",
    "springs.lengths": "n n f2 i2 f1 z",
    "springs.extrapolated": "n n f2 f2 i2 F1 F1 f1 z",
    "springs.energy": "n n f2 i2 F1 F1 z",
    "blocks.rounding": "n n i1 i1 f3 f2 B2 z",
    "springs.hessian": "n n f2 i2 i1 i1 f1 f1 i1 i3 q f3 z",
    "springs.stiffen": "n n f2 i2 f1 f1 f1 f1 z",
    "springs.tensions": "n n f2 i2 F1 F1 f1 z",
    "vectors.scalar_product": "n n f1 f1",
    "springs.internal_forces": "n n f2 i2 i1 i1 f1 f2 z",
    "springs.pulls": "n n f2 i2 F1 F1 f1 z",
    "gaussian.sums": "n n f2 i2 f4 l1 f2 z",
    "sparsity.fill_slots": "n n i2 i1 i1 i3",
    "sparsity.count_neighbours": "n n i2 i1 i1 i1",
    "elements.deformations": "n n f2 f2 l2 f3 f3 f1 n l2 f3 f2 f2 f2 f2 z",
    "sparsity.unique_pairs": "l2 n",
}


def argument_types(signature: str, dim: int) -> tuple[Any, ...]:
    """Return the numba types of a signature, see SIGNATURES."""
    from numba.core import types

    entries = {"f": types.float64, "i": types.int32, "l": types.int64, "b": types.boolean}
    zeros = {"z": types.UniTuple(types.float64, dim), "zz": types.UniTuple(types.float64, dim * dim)}
    known = {"n": types.int64, "q": types.boolean, **zeros}

    def array(code: str) -> Any:
        return types.Array(entries[code[0].lower()], int(code[1]), "C", readonly=code[0].isupper())

    return tuple(known[code] if code in known else array(code) for code in signature.split())


def compile_ahead(dim: int) -> None:
    """Compile the kernels in SIGNATURES that are not in the cache."""
    for name, signature in SIGNATURES.items():
        module, kernel = name.split(".")
        getattr(importlib.import_module(f"truespring.kernels.{module}"), kernel).compile(argument_types(signature, dim))


@contextmanager
def compiling_ahead(dim: int) -> Iterator[None]:
    """Compile kernels in a second process within the block, unless some are in the cache or there is one core only."""
    process = _started(dim) if n_threads() > 1 and _nothing_cached() else None
    try:
        yield
    finally:
        if process is not None:
            process.kill()
            process.communicate()


def _nothing_cached() -> bool:
    """Return whether the cache is empty; False without a compiler or a cache."""
    from truespring.kernels.sparsity import incidence

    folder = getattr(getattr(incidence, "stats", None), "cache_path", None)
    return folder is not None and not any(Path(folder).glob("sparsity.incidence-*.nbi"))


def _started(dim: int) -> "subprocess.Popen[bytes] | None":
    """Start the second process; return None if that is not possible."""
    command = [sys.executable, "-P", "-m", "truespring.kernels.ahead", str(dim)]
    try:
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except OSError:
        return None


def _end_with_parent() -> None:
    """End this process when the other end of its standard input is closed."""
    os.read(sys.stdin.fileno(), 1)  # not sys.stdin.read: its lock would be held at the end of this process
    os._exit(0)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compile_ahead(int(sys.argv[1]))
