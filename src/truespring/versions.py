"""Versions and machine, for a bug report."""

import os
import platform
import sys
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

# Packages that results, pictures and files depend on, the required ones first.
_PACKAGES = (
    *("truespring", "numpy", "scipy", "numba", "llvmlite", "scikit-fem", "pyamg", "pydantic", "pint", "matplotlib"),
    *("pyvista", "vtk", "rslab", "pypardiso", "petsc4py", "dask", "polars", "pandas", "xarray", "h5py"),
    *("starlette", "anywidget", "ipykernel", "imageio-ffmpeg"),
)
_MISSING = "not installed"


@dataclass(frozen=True)
class Report:
    """Versions of truespring and the packages that it uses, and the machine: print it for a bug report.

    Attributes:
        versions: by name of the package; "not installed" for a missing one.
        machine: by name: system, processor, cores, memory, threads of numba, libraries of linear algebra.

    Example:
        >>> import truespring as ts
        >>> ts.Report().versions["truespring"] == ts.__version__
        True
    """

    versions: dict[str, str] = field(default_factory=lambda: _versions())
    machine: dict[str, str] = field(default_factory=lambda: _machine())

    def __str__(self) -> str:
        """Return one line for each package that is installed, and one with the missing ones."""
        missing = [name for name, number in self.versions.items() if number == _MISSING]
        found = {name: number for name, number in self.versions.items() if number != _MISSING}
        lines = {**found, **self.machine} | ({_MISSING: ", ".join(missing)} if missing else {})
        wide = max(map(len, lines))
        return "\n".join(f"{name:{wide}}  {text}" for name, text in lines.items())

    __repr__ = __str__


def _versions() -> dict[str, str]:
    found = {name: _version(name) for name in _PACKAGES}
    return {"truespring": found.pop("truespring"), "python": sys.version.split()[0], **found}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return _MISSING


def _machine() -> dict[str, str]:
    import psutil

    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "system": platform.platform(),
        "processor": f"{platform.machine()} {_processor()}".strip(),
        "cores": f"{psutil.cpu_count(logical=False) or '?'} physical, {os.cpu_count()} logical, {usable} usable",
        "memory": f"{psutil.virtual_memory().total / 2**30:.1f} GiB",
        "BLAS": "; ".join(_libraries()) or "not known",
    }


def _processor() -> str:
    """Return the name of the processor, from /proc/cpuinfo on Linux."""
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8", errors="replace") as lines:
            names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor()


def _libraries() -> list[str]:
    """Return the libraries of linear algebra that numpy and scipy use, with version and threads."""
    import scipy.linalg  # noqa: F401  loads its libraries
    from threadpoolctl import threadpool_info

    several = (one for one in threadpool_info() if one["user_api"] == "blas")
    words = [f"{one['internal_api']} {one['version'] or '?'} ({one['num_threads']} threads)" for one in several]
    return list(dict.fromkeys(words))
