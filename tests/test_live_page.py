"""The page of a live session in headless Chromium: it pulls by the mouse, watches, and asks nothing of others."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import truespring
from tests.browser import MARKS
from truespring.study import read_study

EXAMPLES = Path(truespring.__file__).parent / "examples"

pytestmark = MARKS


@pytest.fixture(params=["block.toml", "strip.toml"])
def address(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    command = [sys.executable, "-m", "truespring", "live", str(EXAMPLES / request.param), "--no-browser"]
    command += ["--seconds", "300", "--quiet", "--record", str(tmp_path / "recorded")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.terminate()
        assert process.wait(30) == 0
    assert read_study(tmp_path / "recorded" / "session.toml").problem.dynamics is not None


class Seen:
    """A page, with what it asked for and what went wrong in it."""

    def __init__(self, browser: Any, address: str, **more: Any) -> None:
        self.page = browser.new_page(**more)
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.page.on("request", lambda one: self.requests.append(one.url))
        self.page.on("websocket", lambda one: self.requests.append(one.url))
        self.page.on("pageerror", lambda one: self.errors.append(str(one)))
        self.page.on("console", lambda one: self.errors.append(one.text) if one.type == "error" else None)
        self.page.goto(address)
        self.until("truespringLive.counts.frames > 5")

    def ask(self, script: str) -> Any:
        return self.page.evaluate(script)

    def until(self, condition: str, patience: int = 400) -> None:
        for _ in range(patience):
            if self.ask(condition):
                return
            self.page.wait_for_timeout(50)
        raise AssertionError(f"not so: {condition}; {self.errors}; {self.ask('truespringLive.readout')}")

    def place(self, node: int) -> list[float]:
        found: list[float] = self.ask(f"[...truespringLive.frame.places.slice({3 * node}, {3 * node + 3})]")
        return found

    def grasped(self) -> tuple[int, list[float]]:
        """Return the drawn node that is farthest to the right, and its pixel in the window."""
        node = self.ask(
            "(() => { const at = truespringLive.body.rest; let far = 0;"
            " for (let i = 0; i < at.length; i += 3) if (at[i] > at[3 * far]) far = i / 3; return far; })()"
        )
        box = self.page.locator("#scene").bounding_box()
        x, y = self.ask(f"truespringLive.pixel({node})")
        return node, [box["x"] + x, box["y"] + y]


def test_a_point_is_pulled_by_the_mouse(address: str, browser: Any) -> None:
    seen = Seen(browser, address, viewport={"width": 1200, "height": 800})
    node, (x, y) = seen.grasped()
    begin = seen.place(node)
    mouse = seen.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x, y - 60, steps=12)
    seen.until("truespringLive.readout.marks.length === 1 && truespringLive.readout.marks[0].force !== null")
    seen.page.wait_for_timeout(1000)
    assert seen.place(node)[1] > begin[1] + 0.03
    assert seen.ask("truespringLive.counts.lags.length") > 3
    seen.until("truespringLive.readout.errors.model !== null && truespringLive.readout.errors.time !== null", 1200)
    assert seen.page.inner_text("#errors").count("%") >= 2
    mouse.up()
    seen.until("truespringLive.readout.marks.length === 0")
    host = re.sub(r"^http://|/.*$", "", address)
    assert all(re.match(rf"(http|ws)://{re.escape(host)}/|data:", one) for one in seen.requests), seen.requests
    assert seen.errors == []
    seen.page.close()


def test_a_second_page_only_watches(address: str, browser: Any) -> None:
    first, second = Seen(browser, address), Seen(browser, address)
    assert second.page.is_visible("#watching") and not first.page.is_visible("#watching")
    assert second.page.is_disabled("#run") and first.page.is_enabled("#run")
    first.page.click("#run")
    second.until("truespringLive.readout.running === false")
    first.page.close()
    second.until("truespringLive.readout.owner")
    second.page.click("#run")
    second.until("truespringLive.readout.running")
    second.page.close()


def test_it_works_by_the_keyboard_and_on_a_phone(address: str, browser: Any) -> None:
    seen = Seen(browser, address, viewport={"width": 390, "height": 780}, has_touch=True, is_mobile=True)
    assert seen.ask("document.documentElement.scrollWidth <= innerWidth")
    seen.page.focus("#scene")
    for key in ("Enter", "ArrowUp", "ArrowUp"):
        seen.page.keyboard.press(key)
    seen.until("truespringLive.readout.marks.length === 1")
    seen.page.keyboard.press("Enter")
    seen.until("truespringLive.readout.marks.length === 0")
    seen.page.keyboard.press(" ")
    seen.until("!truespringLive.readout.running")
    frames = seen.ask("truespringLive.frame.time")
    seen.page.keyboard.press(".")
    seen.until(f"truespringLive.frame.time > {frames}")
    names = seen.ask(
        "[...document.querySelectorAll('input, select, button, canvas')].filter((one) => !(one.textContent"
        " || one.ariaLabel || one.labels && one.labels.length)).map((one) => one.id)"
    )
    assert names == [] and seen.errors == []
    seen.page.close()
