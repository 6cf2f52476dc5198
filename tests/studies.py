"""A small study and ways to change it, for tests of the study file and the command line. It is not refined."""

from pathlib import Path

STUDY = """\
title = "A small cantilever"

[mesh]
shape = "rectangle"
size = ["40 mm", "10 mm"]
elements = [8, 2]

[material]
young = "10 kPa"
poisson = 0.3

[section]
kind = "plane-stress"
thickness = "10 mm"

[[support]]
on = "left"

[[load]]
on = "right"
force = ["0 N", "-0.01 N"]

[solver]
load_steps = 2

[models.springs]
kind = "springs"
rule = "lloyd"

[models.linear]
kind = "fem"
law = "linear"

[compare]
probe = "right-middle"
refine = false
"""


def changed(*changes: tuple[str, str]) -> str:
    """Return the study with each text replaced; a text that does not occur is an error of the test."""
    text = STUDY
    for old, new in changes:
        assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times"
        text = text.replace(old, new)
    return text


def written(folder: Path, text: str = STUDY, name: str = "study.toml") -> Path:
    """Write a study into a folder and return its file."""
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file
