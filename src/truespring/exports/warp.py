"""NVIDIA Warp: a Python script with kernels for springs and elements, and how to mount it in Newton."""

from collections.abc import Mapping

from truespring.exports.arrays import npz
from truespring.exports.exported import Exported
from truespring.exports.motion import motion_of
from truespring.exports.scripts import script


def warp(exported: Exported) -> Mapping[str, str | bytes]:
    """Return springs_warp.py, springs.npz with masses, damping and time step, and newton_mount.py."""
    motion = motion_of(exported)
    more = {
        "mass": motion.mass,
        "start": motion.start,
        "damping": motion.damping,
        "time_step": motion.time_step,
        "settled": motion.duration,
    }
    return {
        "springs_warp.py": script("warp_springs", exported),
        **npz(exported, more),
        "newton_mount.py": script("newton_mount", exported),
    }
