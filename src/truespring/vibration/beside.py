"""Modes of several models of a body beside each other, as values, files and figures."""

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Floats
from truespring.outputs import Output
from truespring.report.drawing import Figures, drawings, save_drawings, sheets
from truespring.report.rows import table_of
from truespring.vibration.figures import Column, mode_figures, write_films
from truespring.vibration.pairing import Pair, like, pairs
from truespring.vibration.result import Modes
from truespring.vibration.series import write_shapes

if TYPE_CHECKING:
    import polars

# Largest number of modes in the figure.
_DRAWN = 8
_COLUMNS = ("model", "mode", "frequency", "modal_mass", "residual", "reference_mode", "difference", "mac")
_UNITS = {"frequency": "Hz", "modal_mass": "kg"}


@dataclass(frozen=True, eq=False)
class StudyModes:
    """The modes of the models of a study.

    Attributes:
        title, file: of the study.
        count: number of modes that were asked for.
        found: modes by name of the model, in the order of the study: `count`, and some more to find equal shapes among.
        reference: name of the model that the others are compared with.
        left_out: names of the models without a potential: other programs, and solutions from files.
    """

    title: str
    file: Path
    count: int
    found: Mapping[str, Modes]
    reference: str
    left_out: tuple[str, ...] = ()

    @property
    def stem(self) -> str:
        """Name of the study file without suffix, and of its output folder."""
        return self.file.stem

    @cached_property
    def pairs(self) -> dict[str, tuple[Pair, ...]]:
        """Modes of the same shape as one of the reference, by name of the other models.

        At least one of the two is among the first `count` modes.
        """
        against = self.found[self.reference]
        every = {name: pairs(against, modes) for name, modes in self.found.items() if name != self.reference}
        return {
            name: tuple(one for one in several if min(one.reference, one.mode) < self.count)
            for name, several in every.items()
        }

    def shown(self, name: str) -> list[int]:
        """Return the modes of a model that are reported, from 0: the first `count`, and those of the pairs."""
        paired = {pair.mode for pair in self.pairs.get(name, ())}
        if name == self.reference:
            paired = {pair.reference for several in self.pairs.values() for pair in several}
        return sorted(paired | set(range(min(self.count, len(self.found[name].frequencies)))))

    @property
    def converged(self) -> bool:
        """Whether all modes are accurate, and no model is unstable at rest."""
        return all(modes.converged and modes.stable for modes in self.found.values())

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row per model and mode, as in modes.csv.

        Modes count from 1; `reference_mode`, `difference` and `mac` are None where no mode of the reference has the
        shape, and for the reference itself.
        """
        rows = []
        for name, modes in self.found.items():
            known = {pair.mode: pair for pair in self.pairs.get(name, ())}
            for number in self.shown(name):
                pair = known.get(number)
                rows.append(
                    {
                        "model": name,
                        "mode": number + 1,
                        "frequency": _number(modes.frequencies[number]),
                        "modal_mass": float(modes.modal_mass[number]),
                        "residual": _number(modes.residuals[number]),
                        "reference_mode": None if pair is None else pair.reference + 1,
                        "difference": None if pair is None else _number(pair.difference),
                        "mac": None if pair is None else pair.mac,
                    }
                )
        return rows

    def table(self) -> "polars.DataFrame":
        """Return `rows` as a table of polars."""
        return table_of(self.rows)

    @property
    def values(self) -> dict[str, Any]:
        """The result as JSON values, in SI units."""
        rows = self.rows
        return {
            "title": self.title,
            "reference": self.reference,
            "models": {
                name: {
                    "label": modes.label,
                    "n_unknowns": modes.n_unknowns,
                    "n_rigid": modes.n_rigid,
                    "converged": modes.converged,
                    "method": modes.method,
                    "seconds": modes.seconds,
                    "warnings": list(modes.warnings),
                    "modes": [_without(row, "model") for row in rows if row["model"] == name],
                }
                for name, modes in self.found.items()
            },
            "left_out": list(self.left_out),
        }

    def columns(self) -> list[Column]:
        """Return what figures show of each model: in each row a mode of the shape of one of the reference."""
        against, columns = self.found[self.reference], []
        for name, modes in self.found.items():
            known = {pair.reference: pair for pair in self.pairs.get(name, ())}
            shapes: list[Floats | None] = []
            words = []
            for number in self.shown(self.reference):
                shape = against.shapes[number]
                pair = known.get(number)
                if pair is not None:
                    shapes.append(like(modes, pair.mode, shape))
                    found = f"{pair.mode + 1}: {modes.frequencies[pair.mode]:.4g} Hz"
                    words.append(f"{found} ({off_words(pair.difference)})")
                else:
                    shapes.append(shape if name == self.reference else None)
                    words.append(f"{number + 1}: {modes.frequencies[number]:.4g} Hz" if name == self.reference else "")
            columns.append(Column(modes, shapes, words))
        return columns

    def figures(self) -> Figures:
        """Return the figure of the modes; `png()` and `svg()` return the bytes of a file."""
        return sheets(mode_figures(self.title, self.columns(), _DRAWN))

    def write(self, out: str | Path, animate: bool = False) -> dict[str, Path]:
        """Write modes.csv, modes.json, the figure and a VTU file of each mode into out/STEM; return paths by name.

        With `animate` also mode_1.gif, mode_2.gif and so on, one for each mode of the reference.
        """
        with Output(Path(out) / self.stem, "modes.json") as output:
            folder = output.staging
            with (folder / "modes.csv").open("w", newline="", encoding="utf-8") as stream:
                csv.writer(stream).writerow(f"{name} [{_UNITS[name]}]" if name in _UNITS else name for name in _COLUMNS)
                csv.DictWriter(stream, _COLUMNS).writerows(self.rows)
            for name, modes in self.found.items():
                write_shapes(modes, self.shown(name), folder, f"{name}_modes")
            save_drawings(drawings(mode_figures(self.title, self.columns(), _DRAWN)), folder / "figures")
            if animate:
                write_films(self.columns(), folder)
            text = json.dumps(self.values, indent=1, allow_nan=False)
            (folder / "modes.json").write_text(text + "\n", encoding="utf-8")
            written = [file.relative_to(folder) for file in sorted(folder.rglob("*")) if file.is_file()]
            output.publish()
        return {str(file): output.folder / file for file in written}

    @property
    def warnings(self) -> list[str]:
        """Sentences on models, each with the name of its model."""
        named = ([f"{name}: {text}" for text in modes.warnings] for name, modes in self.found.items())
        left = [f"{name}: has no modes: another program, or a file, has its solution" for name in self.left_out]
        return [*chain.from_iterable(named), *left]


def off_words(difference: float) -> str:
    """Return a relative difference with its sign as a percentage."""
    return "-" if not np.isfinite(difference) else f"{100 * round(difference, 4) + 0.0:+.2f} %"


def _number(value: float) -> float | None:
    """Return a number, None if it is not finite."""
    return float(value) if np.isfinite(value) else None


def _without(row: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name != key}
