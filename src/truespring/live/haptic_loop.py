"""A session with a page and a haptic device: the body moves in step with the device, the page watches and asks."""

from typing import Any

from truespring.live.haptic import Haptic
from truespring.live.loop import Loop
from truespring.live.settings import FRAME


class HapticLoop(Loop):
    """A loop whose session advances with the packets of a device, and by the clock without one.

    Orders of the page are carried out, and frames are made known, each 1/60 s of simulated time.

    Attributes:
        device: the port of the device.
    """

    def __init__(self, device: Haptic, **more: Any) -> None:
        """Take the port with its session; `more` as `Loop`."""
        super().__init__(device.live, **more)
        self.device = device
        self._frames, self._before = 0, device.live.log

    def turn(self) -> None:
        """Follow a packet, or advance by the clock; paused, as `Loop`."""
        if not self.running:
            super().turn()
            self._frames, self._before = 0, self.live.log
            return
        self._guarded(self._follow)
        if self._frames * self.live.settings.frame < FRAME and self.running:
            return
        frames, self._frames = self._frames, 0
        self._guarded(lambda: self._count(frames, self._before))
        asked = self._asked()
        self._before = self.live.log
        self._end_turn(True, asked)

    def _follow(self) -> None:
        self._frames += self.device.turn()

    def stop(self, seconds: float = 10.0) -> None:
        """End the thread, as `Loop`, and close the port."""
        super().stop(seconds)
        self.device.close()
