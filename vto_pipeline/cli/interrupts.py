"""Ctrl-C and SIGTERM as KeyboardInterrupt, also where Python would drop one."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import suppress
from typing import Any

_AGAIN_S = 0.05  # until the code that cannot raise has been left


class Interrupts:
    """Turns SIGINT and SIGTERM into KeyboardInterrupt until it is closed.

    A handler may run inside a weakref callback, a finalizer or a callback of a C library. Python prints what is raised
    there as "Exception ignored", and the command would run on. Such an interrupt is sent once more, a moment later.

    Attributes:
        seen: Whether there was one, for libraries that lose it and then stumble.
    """

    def __init__(self) -> None:
        self.seen = False
        self._ignored = sys.unraisablehook
        self._again: threading.Timer | None = None
        with suppress(ValueError):  # not the main thread
            for name in (signal.SIGINT, signal.SIGTERM):
                signal.signal(name, self._stop)
        sys.unraisablehook = self._send_again

    def close(self) -> None:
        """Send none again, and leave what cannot be raised to whoever had it before; signals still interrupt."""
        sys.unraisablehook = self._ignored
        if self._again is not None:
            self._again.cancel()

    def _stop(self, *_: object) -> None:
        self.seen = True
        raise KeyboardInterrupt

    def _send_again(self, dropped: Any) -> None:
        if not issubclass(dropped.exc_type, KeyboardInterrupt):
            self._ignored(dropped)
            return
        main = threading.main_thread().ident  # no other thread's: it ends what the main one waits for
        self._again = threading.Timer(_AGAIN_S, signal.pthread_kill, (main, signal.SIGINT))
        self._again.daemon = True
        self._again.start()
