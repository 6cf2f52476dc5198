"""Rebuild docs/validity.md: the maps of all rules, in the plane and in space, solved anew.

Run from the root of the repository: python docs/build_validity.py (or make validity); --workers N takes N processes.
"""

import argparse
import io
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from truespring.report.sheet import Sheet  # noqa: E402
from truespring.validity import LOAD_TYPES, Validity, map_validity  # noqa: E402

IMAGES = "images/validity"

# What stands in the page above this line is written by hand.
REBUILT = "<!-- Below this line everything is rebuilt by docs/build_validity.py. -->"


@dataclass(frozen=True)
class Shown:
    """Maps of one body: a title, what it is, the study, how it differs from that, and what is mapped."""

    name: str
    title: str
    told: str
    study: str
    other: dict[str, str] = field(default_factory=dict)
    asked: dict[str, Any] = field(default_factory=dict)

    @property
    def command(self) -> str:
        """What a user types for the same maps."""
        words = ["truespring map", self.study]
        for name in ("loads", "rules"):
            words += [f"--{name[:-1]} {one}" for one in self.asked.get(name, ())]
        words += [f"--{name} {self.asked[name]}" for name in ("x", "y") if name in self.asked]
        for name, (first, last, *count) in self.asked.get("ranges", {}).items():
            words += [f"--range {name}={first:g}:{last:g}" + "".join(f":{one}" for one in count)]
        return " ".join(words)


SHOWN = (
    Shown(
        "squares",
        "Squares",
        "The soft rectangle of `examples/bending.toml`, 160 mm by 40 mm, of squares in plane stress at Poisson's ratio "
        "1/3, where `projected` is Lloyd's rule.",
        "examples/bending.toml",
        asked={"loads": ["stretch", "compress", "bend", "shear"], "rules": ["all"], "ranges": {"depth": (1, 8)}},
    ),
    Shown(
        "triangles",
        "Triangles",
        "The same rectangle of right triangles, two a square, all diagonals alike. No rule of plain springs realises "
        "the material on them.",
        "examples/bending.toml",
        {"elements = [16, 4]": 'elements = [16, 4]\nelement = "triangle"'},
        {"loads": ["stretch", "bend"], "rules": ["all"], "ranges": {"depth": (1, 8)}},
    ),
    Shown(
        "poisson",
        "Poisson's ratio",
        "Squares again, four through the depth, stretched at Poisson's ratios from 0 to 0.45: where plain "
        "springs have 1/3, a volume term and coupled springs follow the material.",
        "examples/bending.toml",
        asked={
            "loads": ["stretch"],
            "rules": ["isotropic", "isotropic+volume", "projected", "biquadratic"],
            "y": "poisson",
            "ranges": {"poisson": (0.0, 0.45, 9), "load": (0.0, 0.2)},
        },
    ),
    Shown(
        "cubes",
        "Cubes",
        "The block of `examples/soft_block.toml`, 160 mm by 40 mm by 40 mm, at Poisson's ratio 0.45: what plain "
        "springs have is 1/4.",
        "examples/soft_block.toml",
        asked={"loads": ["stretch", "bend"], "rules": ["all"], "ranges": {"depth": (1, 4)}},
    ),
    Shown(
        "cubes_quarter",
        "Cubes at Poisson's ratio 1/4",
        "The same block of a material that plain springs can be, half as long so that it is quickly solved.",
        "examples/soft_block.toml",
        {"poisson = 0.45": "poisson = 0.25", '"160 mm"': '"80 mm"', "[20, 5, 5]": "[8, 4, 4]", '"-0.2 N"': '"-0.5 N"'},
        {
            "loads": ["bend", "shear", "twist"],
            "rules": ["isotropic", "least-squares", "projected"],
            "ranges": {"depth": (1, 4)},
        },
    ),
    Shown(
        "tetrahedra",
        "Body-centred-cubic tetrahedra",
        "That shorter block at 1/4 of the tetrahedra on which Lloyd's rule is isotropic; the depth counts cells.",
        "examples/soft_block.toml",
        {
            "poisson = 0.45": "poisson = 0.25",
            '"160 mm"': '"80 mm"',
            "elements = [20, 5, 5]": 'elements = [6, 3, 3]\nelement = "bcc-tetrahedron"',
            'rule = "isotropic"\nvolume = true': 'rule = "lloyd"',
            '"-0.2 N"': '"-0.5 N"',
        },
        {"loads": ["bend"], "rules": ["lloyd", "van-gelder", "biquadratic"], "ranges": {"depth": (2, 4)}},
    ),
)


def solve(shown: Shown, workers: int) -> Validity:
    """Map a body; one that differs from its study is written anew beside no file of ours."""
    text = (ROOT / shown.study).read_text(encoding="utf-8")
    for old, new in shown.other.items():
        assert old in text, f"{shown.study} holds no {old!r}"
        text = text.replace(old, new)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{shown.name}.toml"
        file.write_text(text, encoding="utf-8")
        return map_validity(file, workers=workers, **shown.asked)


def small_png(sheet: Sheet) -> bytes:
    """A picture in few colours: a third of the bytes."""
    from PIL import Image

    image = Image.open(io.BytesIO(sheet.png())).convert("RGB").quantize(48, dither=Image.Dither.NONE)
    file = io.BytesIO()
    image.save(file, format="png", optimize=True)
    return file.getvalue()


def section(shown: Shown, found: Validity, folder: Path) -> Iterator[str]:
    """The text of one body's maps, its pictures written into `folder`."""
    yield f"## {shown.title}\n\n{shown.told}\n\n```sh\n{shown.command}\n```\n"
    if shown.other:
        changed = "; ".join(f"`{new.splitlines()[-1]}`" for new in shown.other.values())
        yield f"(in a copy of the study with {changed})\n"
    pictures = found.figures()
    for load in dict.fromkeys(one.load.name for one in found.maps):
        yield f"### {LOAD_TYPES[load].did}\n"
        for one, sentence in zip(found.maps, found.verdicts, strict=True):
            if one.load.name == load:
                yield f"* {sentence.replace(one.rule.words, f'**{one.rule.words}**', 1)}"
        names = [name for name in pictures if name.startswith(f"validity_{load}_")]
        cells = []
        for name in names:
            file = f"{shown.name}_{name.removeprefix('validity_')}.png"
            (folder / file).write_bytes(small_png(pictures[name]))
            cells.append(f"![{pictures[name].title}]({IMAGES}/{file})")
        yield "\n| | |\n|---|---|"
        for pair in (cells[start : start + 2] for start in range(0, len(cells), 2)):
            yield f"| {' | '.join([*pair, ''][:2])} |"
        yield ""


def costs(found: Sequence[tuple[Shown, Validity]]) -> Iterator[str]:
    """What the maps took, and to what their references converged."""
    yield "## What it took\n\n| maps | springs paths solved | of the whole grid | reference paths | seconds | "
    yield "reference, at worst |\n|---|---|---|---|---|---|\n"
    for shown, one in found:
        worst = max(reference.error for reference in one.references)
        left = [reference.load.name for reference in one.references if not reference.converged]
        said = f"{100 * worst:.2g} %" + (f", not converged: {', '.join(left)}" if left else "")
        yield (f"| {shown.title} | {one.solves[0]} | {one.full} | {one.solves[1]} | {one.seconds:.0f} | {said} |\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[one.name for one in SHOWN])
    options = parser.parse_args()
    folder = ROOT / "docs" / IMAGES
    folder.mkdir(parents=True, exist_ok=True)
    found, text = [], []
    for shown in SHOWN:
        if shown.name in options.only:
            one = solve(shown, options.workers)
            found.append((shown, one))
            print(f"{shown.name}: {one.solves} paths, {one.seconds:.0f} s", flush=True)
            text.append("\n".join(section(shown, one, folder)))
    page = ROOT / "docs" / "validity.md"
    head = page.read_text(encoding="utf-8").partition(REBUILT)[0]
    took = "".join(costs(found))
    seconds = sum(one.seconds for _, one in found)
    foot = (
        f"\nAll in {seconds / 60:.1f} minutes, truespring {version('truespring')}, {options.workers} "
        f"process{'es' if options.workers > 1 else ''}. Rebuilt by `make validity`.\n"
    )
    loads = "".join(f"| `{one.name}` | {one.how} |\n" for one in LOAD_TYPES.values())
    table = f"{REBUILT}\n\n| load type | supports and load |\n|---|---|\n{loads}"
    page.write_text("\n".join([head + table, *text, took + foot]), encoding="utf-8")


if __name__ == "__main__":
    main()
