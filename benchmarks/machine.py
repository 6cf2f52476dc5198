"""Hardware, versions, commit and date of measurements, without names and paths of the machine."""

import os
import platform
import subprocess
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path

import psutil

_OURS = ("truespring", "numpy", "scipy", "numba", "pyamg", "rslab")


@cache
def hardware() -> dict[str, str | int]:
    """Return the processor, cores, memory and operating system."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count() or 1,
        "memory_bytes": psutil.virtual_memory().total,
        "system": f"{platform.system()} {platform.release().split('-')[0]} {platform.machine()}",
    }


def _processor() -> str:
    """Return model, family and cache of the processor."""
    file = Path("/proc/cpuinfo")
    if file.is_file():
        lines = dict(line.split(":", 1) for line in file.read_text().split("\n\n")[0].splitlines() if ":" in line)
        fields = {name.strip(): value.strip() for name, value in lines.items()}
        parts = [fields.get("model name", "")]
        parts += [f"family {fields['cpu family']} model {fields['model']}"] if "cpu family" in fields else []
        parts += [f"{fields['cache size']} cache a core"] if "cache size" in fields else []
        return ", ".join(parts)
    return platform.processor()


def versions() -> dict[str, str]:
    """Return the versions of Python and of the numerical packages."""
    found = {"Python": platform.python_version()}
    for name in _OURS:
        try:
            found[name] = version(name)
        except ModuleNotFoundError:  # rslab is optional
            continue
    return found


def commit() -> str:
    """Return the commit of the code, empty outside of a repository."""
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    return done.stdout.strip()


def today() -> str:
    """Return the date in UTC."""
    return datetime.now(UTC).date().isoformat()
