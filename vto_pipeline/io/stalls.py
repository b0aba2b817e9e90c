"""Files and folders that do not answer: a network folder whose server is gone neither reads nor fails, it waits.

Nothing can interrupt a thread that waits like that, so a thread of its own touches what may be far away.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TypeVar

from vto_pipeline.errors import InputError

STALLED = "is the disk or the network folder still there?"
"""What to do."""
_PATIENCE = 60.0  # s without an answer: disks that had stopped spinning take tens of seconds
_ANSWERED: set[str] = set()  # folders that have answered this process; asking all files of a batch would take long

Result = TypeVar("Result")
Beat = Callable[[], None]


def answered(path: Path, work: Callable[[Beat], Result]) -> Result:
    """Return what work on a file or folder returns.

    Args:
        path: For the message.
        work: Is called with what it is to call whenever it has had an answer; large work takes as long as it takes.

    Raises:
        InputError: no answer has come for a minute; and whatever the work raises.
    """
    last = time.monotonic()
    found: list[Result] = []
    raised: list[BaseException] = []

    def beat() -> None:
        nonlocal last
        last = time.monotonic()

    def touch() -> None:
        try:
            found.append(work(beat))
        except BaseException as error:  # goes on in the thread that waits for it
            raised.append(error)

    thread = threading.Thread(target=touch, name=f"reads {path}", daemon=True)  # the process ends without it
    thread.start()
    while thread.is_alive():
        thread.join(max(0.0, last + _PATIENCE - time.monotonic()))
        if thread.is_alive() and time.monotonic() >= last + _PATIENCE:
            raise InputError(f"no answer has come for {_PATIENCE:.0f} s", where=str(path), hint=STALLED)
    if raised:
        raise raised[0]
    return found[0]


@contextmanager
def told_if_stalled(path: Path, tell: Callable[[str], None]) -> Iterator[None]:
    """Tell once if what is written to a file or folder takes longer than a minute.

    It is let go on: when the folder answers again, nothing is lost.

    Args:
        path: For the message.
        tell: Gets it, in a thread of its own, as the one that writes can only wait.
    """
    text = f"writing to {path} takes longer than {_PATIENCE:.0f} s: {STALLED} It goes on as soon as that answers"
    timer = threading.Timer(_PATIENCE, tell, [text])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def check_answers(path: Path) -> None:
    """Refuse a file or folder whose folder does not answer; there need be neither.

    Raises:
        InputError: it does not.
    """
    for one in (os.path.dirname(os.path.abspath(path)), os.path.abspath(path)):
        if one not in _ANSWERED:
            answered(Path(one), partial(_is_there, one))
            _ANSWERED.add(one)


def _is_there(name: str, beat: Beat) -> bool:
    return os.path.lexists(name)
