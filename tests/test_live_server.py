"""The server of a live session: its frames, who is let in, wrong messages, and pages that watch."""

import json
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from tests.test_live_loop import loop_of, turns
from truespring.errors import LiveError
from truespring.live.guest import IN_FLIGHT, Guest, Names
from truespring.live.loop import Loop
from truespring.live.orders import Order
from truespring.live.protocol import FRAME, GHOST, HEADER, LARGEST, MARK, frame, ghost, parsed, text
from truespring.live.server import Server, application, listening, page
from truespring.live.snapshot import Overlay

PORT, TOKEN = 8765, "a token"
HOST = f"127.0.0.1:{PORT}"


@pytest.fixture
def running() -> Iterator[Loop]:
    loop = loop_of(clock=None)
    loop.start()
    yield loop
    loop.stop()


@pytest.fixture
def client(running: Loop) -> TestClient:
    return TestClient(application(Server(running, "A <plate>", PORT, TOKEN)), base_url=f"http://{HOST}")


def joined(client: TestClient, token: str = TOKEN, **headers: str) -> Any:
    return client.websocket_connect(f"/session?token={token}", headers={"host": HOST, **headers})


def until(socket: Any, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Return the first message of a kind; frames on the way are answered."""
    for _ in range(2000):
        message = socket.receive()
        if message["type"] == "websocket.close":
            raise WebSocketDisconnect(message["code"])
        if message.get("bytes"):
            socket.send_text(json.dumps({"kind": "seen", "number": HEADER.unpack_from(message["bytes"])[4]}))
            continue
        found: dict[str, Any] = json.loads(message["text"])
        if wanted(found):
            return found
    raise AssertionError("no such message")


# --- messages ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "sent",
    [
        {"kind": "pull", "hand": 0, "node": 3},
        {"kind": "push", "hand": 1, "place": [0, 0.5, -0.5], "radius": 0.1, "clock": 12.5},
        {"kind": "move", "hand": 0, "place": [0.1, 0.2, 0.3]},
        {"kind": "let-go", "hand": 9},
        {"kind": "pin", "node": 0},
        {"kind": "cut", "start": [0, 0, 0], "end": [1, 0, 0], "depth": [0, 0, -1]},
        {"kind": "release", "name": "pin 1"},
        {"kind": "restart"},
        {"kind": "young", "value": 2},
        {"kind": "model", "name": "gaussian"},
        {"kind": "seen", "number": 7},
    ],
)
def test_messages_are_read(sent: dict[str, Any]) -> None:
    read = parsed(json.dumps(sent)).model_dump(exclude_none=True)
    assert read == {key: tuple(one) if isinstance(one, list) else one for key, one in sent.items()}


WRONG = {
    "no JSON": "{",
    "no object": "[1, 2]",
    "no kind": '{"hand": 0}',
    "unknown kind": '{"kind": "quit"}',
    "another key": '{"kind": "restart", "file": "/etc/passwd"}',
    "NaN": '{"kind": "move", "hand": 0, "place": [NaN, 0, 0]}',
    "infinite": '{"kind": "young", "value": 1e999}',
    "too far": '{"kind": "move", "hand": 0, "place": [11, 0, 0]}',
    "two coordinates": '{"kind": "move", "hand": 0, "place": [0, 0]}',
    "no such hand": '{"kind": "let-go", "hand": 10}',
    "half a node": '{"kind": "pin", "node": 1.5}',
    "negative node": '{"kind": "pin", "node": -1}',
    "no name": '{"kind": "model", "name": ""}',
    "a long name": json.dumps({"kind": "model", "name": "a" * 101}),
    "too large": json.dumps({"kind": "model", "name": "a" * LARGEST}),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_messages_are_errors(case: str) -> None:
    with pytest.raises(LiveError, match=f"at most {LARGEST}" if case == "too large" else "message: "):
        parsed(WRONG[case])


# --- frames ------------------------------------------------------------------------------------------


def test_a_frame_holds_places_and_marks_in_units_of_the_body() -> None:
    loop = loop_of()
    loop.ask(Order("pull", "pull 1", node=14))
    loop.ask(Order("push", "sphere 1", (0.02, 0.05), 0.01))
    loop.ask(Order("pause", echo=12.5))
    turns(loop, 2)
    loop.ask(Order("play"))
    turns(loop, 1)
    snapshot = loop.latest
    sent = frame(snapshot)
    kind, flags, marks, body, number, nodes, at, echo = HEADER.unpack_from(sent)
    assert HEADER.size == 32 and (kind, flags, marks, body, number) == (FRAME, 1, 2, 0, snapshot.number)
    assert at == snapshot.time and np.isnan(echo)
    places = np.frombuffer(sent, "<f4", 3 * nodes, HEADER.size).reshape(-1, 3)
    middle, longest = np.array([0.02, 0.01]), 0.04
    assert places[:, :2] == pytest.approx((snapshot.positions - middle) / longest, abs=1e-6) and not places[:, 2].any()
    rows = np.frombuffer(sent, "<f4", MARK * marks, HEADER.size + places.nbytes).reshape(marks, MARK)
    assert rows[0, 0] == 0 and rows[0, 5:7] == pytest.approx((snapshot.marks[0].at - middle) / longest, abs=1e-6)
    assert rows[1] == pytest.approx([2, 0.25, 0, 1, 0, 0, 1, 0])
    assert len(sent) == HEADER.size + places.nbytes + rows.nbytes


def test_a_ghost_holds_places_and_distances() -> None:
    snapshot = loop_of().latest
    apart = np.arange(15.0)
    sent = ghost(snapshot, Overlay(3, "moving", 0.5, snapshot.positions, apart))
    kind, flags, marks, _, number, nodes, at, _ = HEADER.unpack_from(sent)
    assert (kind, flags, marks, number, nodes, at) == (GHOST, 1, 0, 3, 15, 0.5)
    assert np.frombuffer(sent, "<f4", offset=HEADER.size)[3 * nodes :] == pytest.approx(apart / 0.04)
    assert len(sent) == HEADER.size + 16 * nodes


def test_what_is_not_finite_is_null_in_json() -> None:
    assert json.loads(text({"a": [float("nan"), 1.0], "b": (float("inf"),)})) == {"a": [None, 1.0], "b": [None]}


def test_a_page_that_does_not_answer_gets_three_frames() -> None:
    loop = loop_of()
    guest = Guest(loop, Names(), owner=True)
    first = guest.due()
    assert [isinstance(one, str) for one in first] == [True, True, False] and guest.due() == []
    counts = []
    for _ in range(10):
        turns(loop, 1)
        counts.append(sum(isinstance(one, bytes) for one in guest.due()))
    assert sum(counts) == IN_FLIGHT - 1
    guest.take(parsed('{"kind": "seen", "number": 1}'))
    newest = [one for one in guest.due() if isinstance(one, bytes)]
    assert [HEADER.unpack_from(one)[4] for one in newest] == [loop.latest.number]
    for _ in range(9):  # answers that were not asked for are worth nothing
        guest.take(parsed('{"kind": "seen", "number": 1}'))
    sent = 0
    for _ in range(9):
        turns(loop, 1)
        sent += sum(isinstance(one, bytes) for one in guest.due())
    assert sent == IN_FLIGHT


# --- who is let in -----------------------------------------------------------------------------------


def test_the_page_has_a_policy_and_no_address(client: TestClient) -> None:
    answer = client.get(f"/?token={TOKEN}")
    assert answer.status_code == 200 and "A &lt;plate&gt;" in answer.text and "<plate>" not in answer.text
    policy = answer.headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'nonce-") and "unsafe" not in policy
    assert answer.headers["cache-control"] == "no-store" and answer.headers["referrer-policy"] == "no-referrer"
    nonce = policy.split("'nonce-")[1].split("'")[0]
    assert answer.text.count(f'nonce="{nonce}"') == 2
    assert nonce not in client.get(f"/?token={TOKEN}").headers["content-security-policy"]
    assert not [one for one in ("src=", "@import", "url(", "http-equiv") if one in page("", "")]


@pytest.mark.parametrize("name", ["live.js", "live_scene.js", "view.js"])
def test_the_bundle_is_that_of_its_source_and_loads_nothing(name: str) -> None:
    root = Path(__file__).parent.parent
    bundle = (root / "src" / "truespring" / "live" / "live.min.js").read_text("utf-8")
    source = re.sub(r"^import .*?;$", "", (root / "viewer" / name).read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    for line in re.findall(r'"([A-Za-z][^"\n]{5,})"', source):
        assert line in bundle or not line.isascii(), f"{line}: build the bundle anew, npm run build in viewer/"
    assert "The MIT License" in bundle and "</script" not in bundle.lower()
    for word in ("fetch(", "XMLHttpRequest", "importScripts", "eval("):
        assert word not in bundle


REFUSED: dict[str, tuple[str, dict[str, str]]] = {
    "no token": ("", {}),
    "a wrong token": ("token=another", {}),
    "a token of other letters": ("token=%C3%A9", {}),
    "a foreign origin": (f"token={TOKEN}", {"origin": "http://example.org"}),
    "no origin of a file": (f"token={TOKEN}", {"origin": "null"}),
    "another port": (f"token={TOKEN}", {"origin": f"http://127.0.0.1:{PORT + 1}"}),
    "another name": (f"token={TOKEN}", {"host": f"example.org:{PORT}"}),
    "another port of the host": (f"token={TOKEN}", {"host": f"127.0.0.1:{PORT + 1}"}),
}


@pytest.mark.parametrize("case", REFUSED)
def test_others_are_refused(case: str, client: TestClient) -> None:
    query, headers = REFUSED[case]
    assert client.get(f"/?{query}", headers=headers).status_code == 403
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(f"/session?{query}", headers={"host": HOST, **headers}),
    ):
        pass
    assert client.get(f"/?token={TOKEN}").status_code == 200


def test_it_is_bound_to_this_machine() -> None:
    own = listening(0)
    address, port = own.getsockname()
    assert address == "127.0.0.1"
    with pytest.raises(LiveError, match=f"port {port}: "):
        listening(port)
    own.close()


# --- sessions ----------------------------------------------------------------------------------------


def test_a_page_pulls_and_its_pull_ends_with_it(client: TestClient, running: Loop) -> None:
    with joined(client, origin=f"http://{HOST}") as socket:
        body = until(socket, lambda one: one["kind"] == "body")
        assert (body["dim"], body["nodes"], body["unit"], body["size"]) == (2, 15, "mm", 40)
        for message in (
            {"kind": "pull", "hand": 0, "node": 14},
            {"kind": "move", "hand": 0, "place": [0.5, 0.4, 0]},
            {"kind": "pin", "node": 4},
        ):
            socket.send_text(json.dumps(message))
        held = until(socket, lambda one: len(one.get("marks", ())) == 2)
        assert [one["name"] for one in held["marks"]] == ["pull 1", "pin 1"]
    wait_for(lambda: [one.name for one in running.latest.marks] == ["pin 1"])


def wait_for(wanted: Callable[[], bool]) -> None:
    for _ in range(500):
        if wanted():
            return
        time.sleep(0.01)
    raise AssertionError("it does not become so")


def test_wrong_messages_are_answered_and_end_nothing(client: TestClient, running: Loop) -> None:
    with joined(client) as socket:
        for case, sent in WRONG.items():
            socket.send_text(sent)
            assert until(socket, lambda one: one["kind"] == "wrong")["text"], case
        socket.send_bytes(b"\xff\x00")
        assert "message" in until(socket, lambda one: one["kind"] == "wrong")["text"]
        socket.send_text('{"kind": "move", "hand": 3, "place": [0, 0, 0]}')
        assert "hand 3 holds nothing" in until(socket, lambda one: one["kind"] == "wrong")["text"]
        socket.send_text('{"kind": "pause"}')
        assert until(socket, lambda one: one.get("running") is False)


def test_a_page_that_is_mostly_wrong_is_closed(client: TestClient, running: Loop) -> None:
    with joined(client) as socket:
        for _ in range(20):
            socket.send_text("{")
        with pytest.raises(WebSocketDisconnect):
            until(socket, lambda one: one["kind"] == "closed")
    before = running.latest.number
    wait_for(lambda: running.latest.number > before)


def test_a_second_page_watches_until_the_first_has_left(client: TestClient, running: Loop) -> None:
    with joined(client) as first:
        assert until(first, lambda one: "owner" in one)["owner"] is True
        with joined(client) as second:
            assert until(second, lambda one: "owner" in one)["owner"] is False
            second.send_text('{"kind": "pause"}')
            assert "only watches" in until(second, lambda one: one["kind"] == "wrong")["text"]
            first.close()
            assert until(second, lambda one: one.get("owner") is True)
            second.send_text('{"kind": "pause"}')
            assert until(second, lambda one: one.get("running") is False)
