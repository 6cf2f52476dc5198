"""Pages in headless Chromium: axe-core finds no fault in light and dark, controls work, nothing is loaded."""

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import truespring
from tests.browser import MARKS
from truespring.cli import main

EXAMPLES = Path(truespring.__file__).parent / "examples"
VIEWER = Path(__file__).parent.parent / "viewer"
SIZES = {"desktop": (1200, 900), "phone": (390, 800)}

pytestmark = MARKS


@pytest.fixture(scope="module")
def axe(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The source of axe-core, installed by npm unless `make viewer` did so."""
    file = Path("node_modules") / "axe-core" / "axe.min.js"
    if not (VIEWER / file).exists():
        if shutil.which("npm") is None:
            pytest.skip("needs npm, for axe-core")
        version = json.loads((VIEWER / "package.json").read_text())["devDependencies"]["axe-core"]
        folder = tmp_path_factory.mktemp("axe")
        (folder / "package.json").write_text("{}")
        command = ["npm", "install", "--ignore-scripts", "--no-audit", "--no-fund", f"axe-core@{version}"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
        if done.returncode:
            pytest.skip(f"npm cannot install axe-core: {done.stderr[-200:]}")
        return (folder / file).read_text("utf-8")
    return (VIEWER / file).read_text("utf-8")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A page of every kind."""
    folder = tmp_path_factory.mktemp("pages")
    strip, block = (EXAMPLES / f"{name}.toml" for name in ("strip", "block"))
    lloyd = strip.read_text("utf-8").replace('rule = "gaussian"', 'rule = "lloyd"')
    fitted, held = folder / "fitted.toml", folder / "held.toml"
    fitted.write_text(lloyd, encoding="utf-8")
    held.write_text(lloyd.replace('"-0.04 N"', '"0.01 N"'), encoding="utf-8")

    def run(*words: object) -> None:
        main([*map(str, words), "--quiet"])

    run("verify", strip, block, "--animate", "--out", folder / "several")
    run("converge", strip, "--meshes", 3, "--out", folder / "converge")
    run("sweep", strip, "--vary", "material.young=5 kPa,10 kPa", "--out", folder / "sweep")
    run("calibrate", fitted, "--held-out", held, "--out", folder / "calibrate")
    run("map", strip, "--load", "bend", "--rule", "isotropic", "--range", "depth=1:2", "--out", folder / "map")
    found = {"several": folder / "several" / "report.html", "sweep": folder / "sweep" / "report.html"}
    found |= {name: folder / "several" / name / "report.html" for name in ("strip", "block")}
    for name in ("converge", "calibrate", "map"):
        (found[name],) = (folder / name).glob("*/*.html")
    assert all(file.is_file() for file in found.values())
    return found


class Opened:
    """A page, with what it asked for and what went wrong in it."""

    def __init__(self, browser: Any, file: Path, **more: Any) -> None:
        self.context = browser.new_context(**more)
        self.page = self.context.new_page()
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.page.on("request", lambda one: self.requests.append(one.url))
        self.page.on("pageerror", lambda one: self.errors.append(str(one)))
        self.page.on("console", lambda one: self.errors.append(one.text) if one.type == "error" else None)
        self.page.goto(file.as_uri())
        self.page.wait_for_timeout(600)

    def close(self) -> None:
        assert not self.errors
        assert all(one.startswith(("file:", "data:", "blob:")) for one in self.requests)
        self.context.close()

    def picture(self, folder: Path, file: str = "view.png") -> Image.Image:
        """Return what the first view shows."""
        self.page.wait_for_timeout(300)
        self.page.locator("figure.viewer canvas").first.screenshot(path=folder / file)
        return Image.open(folder / file).convert("RGB")


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", ["several", "strip", "block", "converge", "sweep", "calibrate", "map"])
def test_axe_finds_nothing(name: str, scheme: str, size: str, pages: dict[str, Path], browser: Any, axe: str) -> None:
    wide, high = SIZES[size]
    opened = Opened(browser, pages[name], viewport={"width": wide, "height": high}, color_scheme=scheme)
    opened.page.evaluate("for (const one of document.querySelectorAll('details')) one.open = true")
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= wide
    opened.page.evaluate(axe)
    found = opened.page.evaluate("axe.run()")
    told = [(one["id"], one["help"], one["nodes"][0]["html"][:200]) for one in found["violations"]]
    assert not told
    assert {"color-contrast", "image-alt", "label", "button-name"} & {one["id"] for one in found["passes"]}
    opened.close()


def test_axe_finds_a_fault(pages: dict[str, Path], browser: Any, axe: str) -> None:
    opened = Opened(browser, pages["strip"])
    opened.page.evaluate("document.querySelector('.short').style.color = '#ddd'")
    opened.page.evaluate(axe)
    assert "color-contrast" in {one["id"] for one in opened.page.evaluate("axe.run()")["violations"]}
    opened.close()


def test_dark_is_chosen_and_kept(pages: dict[str, Path], browser: Any) -> None:
    opened = Opened(browser, pages["converge"], color_scheme="light")
    paper = "getComputedStyle(document.body).backgroundColor"
    assert opened.page.evaluate(paper) == "rgb(255, 255, 255)"
    opened.page.keyboard.press("Tab")  # the link to the content
    opened.page.keyboard.press("Tab")
    opened.page.keyboard.press("Enter")
    assert opened.page.get_attribute(".theme", "aria-pressed") == "true"
    dark = opened.page.evaluate(paper)
    assert max(map(int, re.findall(r"\d+", dark))) < 60
    opened.page.reload()
    assert opened.page.evaluate(paper) == dark
    opened.page.emulate_media(media="print")
    assert opened.page.evaluate(paper) == "rgb(255, 255, 255)"
    opened.close()


def test_figures_tables_and_the_animation_are_saved(pages: dict[str, Path], browser: Any, tmp_path: Path) -> None:
    opened = Opened(browser, pages["strip"], accept_downloads=True)

    def saved(place: Any) -> Path:
        with opened.page.expect_download() as download:
            place.click()
        file = tmp_path / download.value.suggested_filename
        download.value.save_as(file)
        return file

    curves = opened.page.locator("figure:has(img[data-name=strip_curves])")
    own = pages["strip"].parent
    assert saved(curves.locator("button", has_text="SVG")).read_bytes()[:5] == b"<?xml"
    picture = Image.open(saved(curves.locator("button", has_text="PNG"))).convert("L")
    assert picture.width > 1500 and picture.getpixel((3, 3)) == 255 and min(picture.getdata()) < 60
    table = saved(opened.page.locator("a[download$='curves.csv']"))
    assert table.name == "strip_curves.csv" and table.read_bytes() == (own / "curves.csv").read_bytes()
    opened.page.locator("summary", has_text="Animation").click()
    film = saved(opened.page.locator("figure:has(img[data-name=strip_animation]) button"))
    assert film.read_bytes() == (own / "animation.gif").read_bytes()
    view = Image.open(saved(opened.page.locator("button.save")))
    assert view.getpixel((1, 1))[:3] == (255, 255, 255)
    opened.close()


def test_the_view_in_space_is_coloured_cut_and_read(pages: dict[str, Path], browser: Any, tmp_path: Path) -> None:
    opened = Opened(browser, pages["block"])
    plain = opened.picture(tmp_path, "plain.png")
    seen = [plain.tobytes()]
    for color in opened.page.locator("select[name=color] option").evaluate_all("all => all.map(one => one.value)")[1:]:
        opened.page.select_option("select[name=color]", color)
        seen.append(opened.picture(tmp_path).tobytes())
    assert len(seen) >= 5 and len(set(seen)) == len(seen)
    opened.page.select_option("select[name=color]", "stretch")
    whole = opened.picture(tmp_path)
    opened.page.select_option("select[name=cut]", "0")
    half = opened.picture(tmp_path)
    opened.page.check("input[name=half]")
    other = opened.picture(tmp_path)
    assert len({whole.tobytes(), half.tobytes(), other.tobytes()}) == 3
    opened.page.select_option("select[name=cut]", "")
    canvas, words = opened.page.locator("canvas.scene"), opened.page.locator("output.node")
    canvas.focus()
    opened.page.keyboard.press("n")
    assert re.match(r"node 0\b.*displacement \(", words.inner_text(), flags=re.DOTALL)
    opened.page.keyboard.press("Escape")
    assert words.inner_text().startswith("Point at a node")
    box = canvas.bounding_box()
    found = False
    for share in range(20, 80):  # across the middle of the picture
        opened.page.mouse.move(box["x"] + share / 100 * box["width"], box["y"] + 0.5 * box["height"])
        found = found or words.inner_text().startswith("node")
    assert found
    opened.close()


def test_the_plane_view_is_coloured_and_read(pages: dict[str, Path], browser: Any, tmp_path: Path) -> None:
    opened = Opened(browser, pages["strip"], has_touch=True)
    canvas, words = opened.page.locator("figure.viewer canvas"), opened.page.locator("output.node")
    opened.page.select_option("select[name=color]", "displacement")
    colours = {pixel for _, pixel in opened.picture(tmp_path).getcolors(10**6)}
    assert any(red > 220 and 100 < green < 200 for red, green, _ in colours)  # orange, in the middle of the range
    canvas.focus()
    for _ in range(3):
        opened.page.keyboard.press("n")
    assert words.inner_text().startswith("node 2")
    box = canvas.bounding_box()
    opened.page.touchscreen.tap(box["x"] + 2, box["y"] + box["height"] - 2)
    assert words.inner_text().startswith("Point at a node")
    opened.close()
