"""When the frames of a live stream begin."""

from __future__ import annotations


class Pace:
    """Frames at even times, as long as they can be made.

    A frame that comes late is begun at once, and those after it catch up. So frames whose length varies come as often
    as they do on average, where waiting for the next even time would halve their rate. What is late by more than a
    whole frame is left out: the stream would only fall behind.

    Args:
        period: From one frame to the next [s].
        began: When the first one begins [s].

    Attributes:
        due: When the next frame is due [s].
    """

    def __init__(self, period: float, began: float) -> None:
        self._period = period
        self.due = began

    def made(self, now: float) -> int:
        """Set when the next frame is due, as one is made; return how many are left out before.

        Args:
            now: [s].
        """
        self.due += self._period
        missed = int(max(now - self.due, 0.0) / self._period)
        self.due += missed * self._period
        return missed
