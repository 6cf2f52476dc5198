"""The haptic port: what comes back is the force of the grasp at that place, and nothing else moves the body."""

import math
import runpy
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.errors import LiveError
from truespring.live import Live
from truespring.live.haptic import GRASP, SPHERE, Haptic
from truespring.live.haptic_loop import HapticLoop
from truespring.live.orders import Order
from truespring.live.packets import FRAME, HOLD, TOUCH, Reply, Request, packed_request, read_reply
from truespring.problem import Problem

CLIENT = Path(__file__).parents[1] / "examples" / "haptic_client.py"
TOKEN = 0x0123456789ABCDEF
AT = (0.03, 0.01, 0.01)


def live_bar() -> Live:
    body = Problem(
        ts.box((0.03, 0.01, 0.01), (3, 1, 1)),
        ts.Material(young=3000.0, poisson=0.3, density=1000.0),
        supports=ts.Fixed(on="left"),
        dynamics=ts.Dynamics(1.0),
    )
    return Live(body, ts.Springs(rule="gaussian"), frame=1e-3)


class Device:
    """A device that sends one packet at a time, and the port, which is turned once for each."""

    def __init__(self, haptic: Haptic) -> None:
        self.haptic = haptic
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", haptic.port))
        self.socket.setblocking(False)

    def send(self, packet: bytes) -> Reply | None:
        self.socket.send(packet)
        self.haptic.turn()
        try:
            return read_reply(self.socket.recv(128))
        except BlockingIOError:
            return None

    def ask(self, number: int, place: tuple[float, ...] = AT, flags: int = HOLD, token: int = TOKEN) -> Reply | None:
        x, y, z = place
        return self.send(packed_request(token, Request(flags, number, 0.5 * number, (x, y, z))))


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@contextmanager
def exchange(clock: Clock | None = None) -> Iterator[tuple[Haptic, Device, Live]]:
    live = live_bar()
    with live, Haptic(live, token=TOKEN, clock=clock or Clock()) as haptic:
        device = Device(haptic)
        try:
            yield haptic, device, live
        finally:
            device.socket.close()


def place_at(number: int) -> tuple[float, float, float]:
    return AT[0], AT[1], AT[2] + 2e-5 * number


def test_the_force_is_that_of_a_scripted_pull_bit_for_bit() -> None:
    with exchange() as (_, device, _), live_bar() as scripted:
        for number in range(20):
            scripted.pull(AT, place_at(number) if number else None, name=GRASP)
            scripted.step()
            found = device.ask(number, place_at(number))
            assert found is not None
            assert (found.sequence, found.frames, found.total, found.flags) == (number, 1, number + 1, HOLD)
            assert found.force == tuple(scripted.forces[GRASP])
            assert (found.time, found.clock) == (scripted.time, 0.5 * number)
        assert math.hypot(*found.force) > 0


def test_where_the_device_closes_is_where_the_patch_is() -> None:
    """A device that closes beside the body holds the nearest patch without a jump."""
    with exchange() as (_, device, live):
        found = device.ask(1, (0.04, 0.02, 0.01))
        assert found is not None
        np.testing.assert_allclose(found.force, 0.0, atol=1e-15)
        device.ask(2, (0.04, 0.02, 0.011))
        np.testing.assert_allclose(live.grasps[GRASP].end, [0.0, 0.0, 0.001], atol=1e-17)


def test_the_frame_has_64_bytes_as_documented() -> None:
    request = packed_request(TOKEN, Request(HOLD, 7, 0.25, (1.0, 2.0, 3.0)))
    assert len(request) == FRAME.size == 64
    assert request[:8] == b"TSHP\x01\x01\x00\x00"
    assert struct.unpack_from("<II", request, 8) == (7, 0)
    assert struct.unpack_from("<Q", request, 16) == (TOKEN,)
    assert struct.unpack_from("<ddddd", request, 24) == (0.25, 1.0, 2.0, 3.0, 0.0)


GOOD = packed_request(TOKEN, Request(HOLD, 1, 0.0, AT))


@pytest.mark.parametrize(
    ("packet", "why"),
    [
        (GOOD[:-1], "size"),
        (GOOD + b"\0", "size"),
        (b"", "size"),
        (b"X" + GOOD[1:], "magic"),
        (GOOD[:4] + b"\2" + GOOD[5:], "version"),
        (packed_request(TOKEN ^ 1, Request(HOLD, 1, 0.0, AT)), "token"),
        (packed_request(TOKEN, Request(HOLD, 1, 0.0, (math.nan, 0.0, 0.0))), "numbers"),
        (packed_request(TOKEN, Request(HOLD, 1, math.inf, AT)), "numbers"),
        (packed_request(TOKEN, Request(128, 1, 0.0, AT)), "numbers"),
    ],
)
def test_a_wrong_packet_has_no_answer_and_moves_nothing(packet: bytes, why: str) -> None:
    with exchange() as (haptic, device, live):
        assert device.send(packet) is None
        assert haptic.counts == {why: 1}
        assert (live.log.frames, live.log.commands) == (0, [])
        assert device.ask(1) is not None


def test_old_packets_are_left_out_and_lost_ones_are_made_up_for() -> None:
    with exchange() as (haptic, device, live):
        found = [device.ask(number) for number in (2**32 - 2, 2**32 - 1, 2**32 - 1, 2**32 - 2, 1, 100)]
        assert [one and one.frames for one in found] == [1, 1, None, None, 2, 4]
        assert [one and one.sequence for one in found if one] == [2**32 - 2, 2**32 - 1, 1, 100]
        assert haptic.counts["old"] == 2
        assert live.log.frames == 8


def test_of_packets_that_wait_the_newest_is_followed() -> None:
    with exchange() as (haptic, device, live):
        device.ask(1)
        for number in (2, 3):
            device.socket.send(packed_request(TOKEN, Request(HOLD, number, 0.0, place_at(number))))
        found = device.ask(4, place_at(4))
        assert found is not None
        assert (found.sequence, found.frames) == (4, 3)
        assert haptic.counts["late"] == 2
        assert [one.place for one in live.log.commands if one.kind == "move"] == [place_at(4)]


def test_one_device_at_a_time() -> None:
    with exchange() as (haptic, device, _):
        device.ask(1)
        other = Device(haptic)
        assert other.ask(2) is None
        assert haptic.counts["other device"] == 1
        other.socket.close()


def test_a_silent_device_holds_on_and_is_then_released() -> None:
    clock = Clock()
    with exchange(clock) as (haptic, device, live):
        device.ask(1)
        device.ask(2, place_at(30))
        assert haptic.is_followed
        assert live.log.frames == 2
        clock.now += 0.2
        assert haptic.turn() == 4  # the body moves on, at most so many frames at once
        assert not haptic.is_followed
        assert GRASP in live.grasps
        clock.now += 0.0025
        assert haptic.turn() == 2
        clock.now += 0.9
        haptic.turn()
        assert GRASP not in live.grasps
        other = Device(haptic)  # another may come, with numbers of its own
        found = other.ask(1)
        other.socket.close()
        assert found is not None
        assert found.flags == HOLD


def test_opening_the_device_releases() -> None:
    with exchange() as (_, device, live):
        device.ask(1)
        found = device.ask(2, flags=0)
        assert found is not None
        assert (found.flags, found.force) == (0, (0.0, 0.0, 0.0))
        assert not live.grasps


def test_a_device_that_touches_moves_a_sphere() -> None:
    with exchange() as (_, device, live):
        centre = live.positions.max(axis=0) + 0.001
        found = device.ask(1, tuple(centre), flags=TOUCH)
        assert found is not None
        assert found.flags == TOUCH
        assert found.force == tuple(live.forces[SPHERE])
        assert math.hypot(*found.force) > 0
        device.ask(2, flags=0)
        assert not live.spheres


def test_a_flood_of_wrong_packets_does_not_stop_the_body() -> None:
    clock = Clock()
    with exchange(clock) as (haptic, device, live):
        for _ in range(150):
            device.socket.send(b"flood")
        clock.now += 0.0035
        haptic.turn()
        assert live.log.frames == 3


def test_a_port_that_is_not_free_is_an_error() -> None:
    with exchange() as (haptic, _, live):
        with pytest.raises(LiveError, match="take another"):
            Haptic(live, haptic.port)
        with pytest.raises(LiveError, match="take another"):
            Haptic(live, 70000)


def test_the_client_of_the_examples_feels_the_body() -> None:
    with live_bar() as live, Haptic(live, token=TOKEN) as haptic:
        exchanged, ended = runpy.run_path(str(CLIENT))["exchanged"], threading.Event()

        def work() -> None:
            while not ended.is_set():
                haptic.turn()

        thread = threading.Thread(target=work)
        thread.start()
        try:
            forces, measured = exchanged(haptic.port, TOKEN, AT, 0.002, seconds=0.2)
        finally:
            ended.set()
            thread.join()
        assert len(forces) >= 20
        assert np.linalg.norm(forces, axis=1).max() > 0
        assert measured["packets a second"] > 0
        assert haptic.counts["followed"] >= len(forces)


def test_a_page_watches_while_the_device_moves_the_body() -> None:
    """A loop with a device: the frame of the page comes each 1/60 s, and its orders are carried out then."""
    with live_bar() as live, Haptic(live, token=TOKEN, clock=Clock()) as haptic:
        loop = HapticLoop(haptic)
        shown: list[float] = []
        loop.watch(lambda: shown.append(loop.latest.time))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
            device.connect(("127.0.0.1", haptic.port))
            device.settimeout(5.0)
            loop.ask(Order("gravity", value=0.0))
            for number in range(40):
                device.send(packed_request(TOKEN, Request(HOLD, number, 0.0, place_at(number))))
                loop.turn()
                assert read_reply(device.recv(128)).frames == 1
        np.testing.assert_allclose(shown, [0.017, 0.034], rtol=1e-9)
        assert [one.kind for one in live.log.commands].count("gravity") == 1
        loop.ask(Order("pause"))
        for _ in range(20):
            loop._follow()
        assert live.log.frames == 40
