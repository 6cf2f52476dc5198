"""What machine and which programs the numbers are of: no names, no places."""

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
    told = Path("/proc/cpuinfo")
    if told.is_file():
        lines = dict(line.split(":", 1) for line in told.read_text().split("\n\n")[0].splitlines() if ":" in line)
        fields = {name.strip(): value.strip() for name, value in lines.items()}
        parts = [fields.get("model name", "")]
        parts += [f"family {fields['cpu family']} model {fields['model']}"] if "cpu family" in fields else []
        parts += [f"{fields['cache size']} cache a core"] if "cache size" in fields else []
        return ", ".join(parts)
    return platform.processor()


def versions() -> dict[str, str]:
    """Return the version of Python and of what truespring computes with."""
    found = {"Python": platform.python_version()}
    for name in _OURS:
        try:
            found[name] = version(name)
        except ModuleNotFoundError:  # rslab may be absent
            continue
    return found


def commit() -> str:
    """Return the commit that is measured, empty outside of a repository."""
    told = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    return told.stdout.strip()


def today() -> str:
    """Return the date, in universal time."""
    return datetime.now(UTC).date().isoformat()
