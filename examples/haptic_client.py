"""A haptic device in software: hold a live body, move on a circle at 1 kHz, and measure rate and jitter.

Start a session with a haptic port, then this client with the port and the token that are printed:

    truespring live examples/soft_block.toml --haptic 0
    python examples/haptic_client.py PORT TOKEN --at 0.06 0.03 0.03 --radius 0.005 --seconds 5

It needs nothing but Python's standard library: take it as a pattern for the driver of a device.
"""

import argparse
import math
import socket
import struct
import time
from collections.abc import Sequence
from itertools import pairwise

# magic, version, flags, 0, sequence, frames, token, clock [s], vector [m or N], clock [s]: 64 bytes, little-endian.
FRAME = struct.Struct("<4sBBHIIQd3dd")
MAGIC, VERSION, HOLD = b"TSHP", 1, 1


def exchanged(
    port: int, token: int, at: Sequence[float], radius: float, seconds: float, rate: float = 1000.0
) -> tuple[list[tuple[float, ...]], dict[str, float]]:
    """Return the forces [N], and rate, jitter and round trips [us] of a circle about a place [m] in the plane x, y."""
    device = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    device.connect(("127.0.0.1", port))
    device.settimeout(0.05)
    forces: list[tuple[float, ...]] = []
    sent, trips = [], []
    begin = time.perf_counter()
    count = max(1, round(seconds * rate))
    for number in range(count):
        while (now := time.perf_counter()) < begin + number / rate:
            pass  # a device has a clock; sleep() comes back too late
        turn = 2 * math.pi * number / rate
        place = (at[0] + radius * math.sin(turn), at[1] + radius * (1 - math.cos(turn)), at[2])
        device.send(FRAME.pack(MAGIC, VERSION, HOLD, 0, number, 0, token, now, *place, 0.0))
        sent.append(now)
        try:
            reply = FRAME.unpack(device.recv(FRAME.size))
        except OSError:  # late, or the session has ended
            continue
        trips.append(time.perf_counter() - reply[-1])
        forces.append(reply[8:11])
    device.close()
    gaps = sorted(abs(later - one - 1 / rate) for one, later in pairwise(sent)) or [0.0]
    trips = sorted(trips) or [math.nan]
    micro = 1e6
    return forces, {
        "packets a second": (len(sent) - 1) / (sent[-1] - sent[0]) if len(sent) > 1 else math.nan,
        "answered, %": 100 * len(forces) / count,
        "jitter, median": micro * gaps[len(gaps) // 2],
        "jitter, 99 %": micro * gaps[int(0.99 * (len(gaps) - 1))],
        "round trip, median": micro * trips[len(trips) // 2],
        "round trip, 99 %": micro * trips[int(0.99 * (len(trips) - 1))],
        "round trip, largest": micro * trips[-1],
    }


def main() -> None:
    """Exchange frames with a session, and print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("port", type=int)
    parser.add_argument("token", type=lambda text: int(text, 16), help="as printed, 16 hexadecimal digits")
    parser.add_argument("--at", type=float, nargs=3, default=(0.0, 0.0, 0.0), help="where to hold the body [m]")
    parser.add_argument("--radius", type=float, default=0.005, help="of the circle [m]")
    parser.add_argument("--seconds", type=float, default=5.0)
    options = parser.parse_args()
    forces, measured = exchanged(options.port, options.token, options.at, options.radius, options.seconds)
    largest = max((math.hypot(*force) for force in forces), default=0.0)
    print(f"largest force {largest:.4g} N in {len(forces)} answers")
    for name, value in measured.items():
        print(f"{name:>22}: {value:.5g}{' us' if 'jitter' in name or 'trip' in name else ''}")


if __name__ == "__main__":
    main()
