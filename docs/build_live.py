"""Film a live session in headless Chromium: python docs/build_live.py; writes docs/images/live.gif.

Needs playwright and Chromium; give its path in CHROMIUM if it is not /usr/bin/chromium.
"""

import io
import os
import re
import subprocess
import sys
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).parents[1]
#: The study, and the size of the page and of the film in pixels.
STUDY, PAGE, FILM = ROOT / "examples" / "organ.toml", (1100, 760), (720, 497)
#: Where the body is pulled, as shares of the canvas, and how far, in pixels.
FROM, BY = (0.40, 0.70), (-70, 30)
#: Time between pictures [s], pictures while it is pulled, held still and let go.
EACH, PULLED, HELD, FREE = 0.1, 18, 60, 22
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def address(session: "subprocess.Popen[str]") -> str:
    """Return the address that a session prints."""
    assert session.stdout
    for line in session.stdout:
        if found := re.search(r"http://\S+", line):
            return found.group()
    sys.exit("the session printed no address")


def picture(page: Page) -> Image.Image:
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB").resize(FILM, Image.Resampling.LANCZOS)


def filmed(page: Page) -> list[Image.Image]:
    """Return pictures of a body that is pulled, held still until it is compared, and let go."""
    box = page.locator("canvas").first.bounding_box()
    assert box
    x, y = (box[side] + share * box[size] for side, share, size in (("x", FROM[0], "width"), ("y", FROM[1], "height")))
    found = [picture(page)]
    page.mouse.move(x, y)
    page.mouse.down()
    for number in range(PULLED + HELD):
        if number < PULLED:
            share = (number + 1) / PULLED
            page.mouse.move(x + share * BY[0], y + share * BY[1])
        time.sleep(EACH)
        found.append(picture(page))
    page.mouse.up()
    for _ in range(FREE):
        time.sleep(EACH)
        found.append(picture(page))
    return found


def main() -> None:
    command = [sys.executable, "-m", "truespring", "live", str(STUDY), "--no-browser"]
    session = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        with sync_playwright() as programs:
            browser = programs.chromium.launch(
                executable_path=os.environ.get("CHROMIUM", "/usr/bin/chromium"), args=list(FLAGS)
            )
            page = browser.new_page(viewport={"width": PAGE[0], "height": PAGE[1]})
            page.goto(address(session))
            page.wait_for_selector("canvas")
            time.sleep(3)
            page.get_by_label("Gravity").uncheck()  # with it a few voxels are inverted before any pull
            time.sleep(12)
            pictures = filmed(page)
            browser.close()
    finally:
        session.terminate()
        session.wait()
    kept = [*pictures[: PULLED + 1], *pictures[PULLED + 1 : PULLED + HELD : 3], *pictures[PULLED + HELD :]]
    both = Image.new("RGB", (2 * FILM[0], FILM[1]))  # without colours of the distance, and with them
    both.paste(kept[0], (0, 0))
    both.paste(kept[len(kept) // 2], (FILM[0], 0))
    palette = both.quantize(128)
    frames = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in kept]
    file = ROOT / "docs" / "images" / "live.gif"
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=120, loop=0, optimize=True)
    print(f"{file}: {len(frames)} pictures, {file.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
