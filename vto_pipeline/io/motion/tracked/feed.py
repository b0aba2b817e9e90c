"""The newest frame of a stream that may be faster than who asks, or slower."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import BinaryIO

from vto_pipeline.errors import FormatError
from vto_pipeline.io.motion.tracked.live import LiveFrame, LiveJoints

_LONGEST_LINE = 1_000_000  # bytes
_RATE = 30.0
"""Frames a second of a recording whose lines do not say."""


class Feed:
    """Reads lines in a thread of its own, and keeps the newest frame.

    Args:
        stream: Of lines.
        source: Its name, for messages.
        refused: Called with what is wrong with a line that is no frame; the stream goes on.
        replay: Whether lines are taken when their times have come, as those of a recording, not as they come.

    Attributes:
        frames: Read so far.
        skipped: Frames of these that were never asked for, as a newer one was there.
        refusals: Lines that were no frames.
        waits_for: Joints that are needed and were not seen yet.
    """

    def __init__(
        self, stream: BinaryIO, source: str, refused: Callable[[FormatError], None], *, replay: bool = False
    ) -> None:
        self._stream = stream
        self._joints = LiveJoints(source)
        self._refused = refused
        self._replay = replay
        self.frames = self.skipped = self.refusals = 0
        self._newest: LiveFrame | None = None
        self._first: tuple[float, float] | None = None  # its time by its own clock and by ours [s]
        self._changed = threading.Condition()
        self._over = False
        self._broken: Exception | None = None
        threading.Thread(target=self._read, name="skeletons", daemon=True).start()

    @property
    def waits_for(self) -> tuple[str, ...]:
        """Joints that are needed and were not seen yet."""
        return self._joints.missing

    def take(self, patience: float = 0.0) -> LiveFrame | None:
        """Return the newest frame that was not taken yet; None if none comes in so many seconds, or any more."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest is not None or self._over, patience)
            newest, self._newest = self._newest, None
        if newest is None and self._broken is not None:
            raise self._broken
        return newest

    @property
    def over(self) -> bool:
        """Whether the stream has ended, and its last frame was taken."""
        with self._changed:
            return self._over and self._newest is None

    def _read(self) -> None:
        try:
            while line := self._stream.readline(_LONGEST_LINE):
                try:
                    frame = self._joints.read(line)
                except FormatError as error:
                    self.refusals += 1
                    self._refused(error)
                    continue
                if frame is not None:
                    self._keep(frame)
        except Exception as error:
            self._broken = error  # for who asks: this thread has nobody to tell
        finally:
            with self._changed:
                self._over = True
                self._changed.notify_all()

    def _keep(self, frame: LiveFrame) -> None:
        if self._replay:
            now = time.perf_counter()
            seconds = self.frames / _RATE if frame.seconds is None else frame.seconds
            self._first = self._first or (seconds, now)
            time.sleep(max(0.0, self._first[1] + seconds - self._first[0] - now))
        with self._changed:
            self.frames += 1
            self.skipped += self._newest is not None
            self._newest = frame
            self._changed.notify_all()
