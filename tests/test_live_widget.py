"""The widget of a notebook, without a browser: messages of the mouse in, frames out."""

import asyncio
import importlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from truespring.live import Live
from truespring.live.protocol import HEADER

pytest.importorskip("anywidget")
widget = importlib.import_module("truespring.live.widget")
ROOT = Path(__file__).parent.parent


def bar() -> Live:
    body = ts.Problem(
        ts.box((0.03, 0.01, 0.01), (3, 1, 1)),
        ts.Material(young=30000.0, poisson=0.3, density=1000.0),
        supports=ts.Fixed(on="left"),
        dynamics=ts.Dynamics(1.0),
    )
    return Live(body, ts.Springs(rule="gaussian"))


def places(shown: Any) -> np.ndarray:
    """Positions that the page draws [m], of the nodes of the surface in order, shape (n, 3)."""
    body = json.loads(shown.body)
    n_nodes = HEADER.unpack_from(shown.frame)[5]
    steps = np.frombuffer(shown.frame, "<f4", 3 * n_nodes, HEADER.size).reshape(-1, 3)
    return body["middle"] + body["longest"] * steps.astype(float)


def say(shown: Any, **message: Any) -> None:
    shown._handle_custom_msg(json.dumps(message), [])


def test_it_draws_the_body_as_it_is() -> None:
    with bar() as live:
        shown = widget.LiveWidget(live)
        np.testing.assert_allclose(places(shown), live.positions, atol=1e-8)
        live.pull((0.03, 0.01, 0.01), (0.03, 0.012, 0.01))
        live.step(3)
        shown.update()
        np.testing.assert_allclose(places(shown), live.positions, atol=1e-8)
        assert HEADER.unpack_from(shown.frame)[6] == live.time
        shown.close()


def test_the_mouse_pulls_the_body_through_the_kernel() -> None:
    with bar() as live:
        shown = widget.LiveWidget(live)
        node = live.problem.mesh.n_nodes - 1
        say(shown, kind="pull", hand=0, node=node)
        (name,) = live.grasps
        say(shown, kind="move", hand=0, place=[0.5, 0.3, 0.2])
        live.step(2)
        body = json.loads(shown.body)
        aim = np.array(body["middle"]) + body["longest"] * np.array([0.5, 0.3, 0.2])
        np.testing.assert_allclose(live.grasps[name].place, aim, rtol=1e-12)
        say(shown, kind="let-go", hand=0)
        assert not live.grasps
        shown.close()


def test_a_cut_changes_what_is_drawn() -> None:
    with bar() as live:
        shown = widget.LiveWidget(live)
        before = json.loads(shown.body)
        say(shown, kind="cut", start=[0.0, -2.0, 3.0], end=[0.0, 2.0, 3.0], depth=[0.0, 0.0, -6.0])
        after = json.loads(shown.body)
        assert live.elements_left.tolist() == [0, 2]
        assert (before["elements"], after["elements"]) == (3, 2)
        assert HEADER.unpack_from(shown.frame)[3] == after["number"] != before["number"]
        shown.close()


@pytest.mark.parametrize(
    "message",
    [{"kind": "pull", "hand": 0, "node": 999}, {"kind": "fly"}, {"kind": "move", "hand": 0, "place": [1e9] * 3}],
)
def test_a_wrong_message_is_answered_and_changes_nothing(message: dict[str, Any]) -> None:
    with bar() as live:
        shown = widget.LiveWidget(live)
        say(shown, **message)
        assert shown.message
        assert not live.log.commands
        shown._handle_custom_msg({"kind": "restart"}, [])  # not text
        shown.close()


def test_it_runs_while_the_kernel_waits() -> None:
    async def waits(shown: Any) -> None:
        say(shown, kind="play")
        assert shown.running
        for _ in range(200):
            await asyncio.sleep(0.005)
            if shown.live.log.frames > 2:
                break
        say(shown, kind="pause")
        frames = shown.live.log.frames
        await asyncio.sleep(0.05)
        assert shown.live.log.frames == frames > 2
        assert not shown.running

    with bar() as live:
        shown = widget.LiveWidget(live)
        asyncio.run(waits(shown))
        np.testing.assert_allclose(places(shown), live.positions, atol=1e-8)
        shown.close()


def test_the_bundle_is_that_of_its_source() -> None:
    bundle = (ROOT / "src" / "truespring" / "live" / "widget.min.js").read_text("utf-8")
    source = (ROOT / "viewer" / "widget.js").read_text("utf-8")
    for line in re.findall(r'"([A-Za-z][^"\n]{5,})"', re.sub(r"^import .*?;$", "", source, flags=re.MULTILINE)):
        assert line in bundle, f"{line}: build the bundle anew, npm run build in viewer/"
    assert "The MIT License" in bundle
    assert re.search(r"export\{\w+ as default\}", bundle)
