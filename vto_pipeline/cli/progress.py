"""Progress of a run on stderr: bars on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from vto_pipeline.cli.session import Session
from vto_pipeline.pipeline.execution.listener import Listener
from vto_pipeline.pipeline.execution.record import StageRecord
from vto_pipeline.pipeline.stage import Stage

_SILENCE = 5.0
"""Least time between two plain lines of one stage [s]."""
_GUESSABLE = 0.02
"""So much must be done before the time left is guessed."""


@contextmanager
def show_progress(session: Session) -> Iterator[Listener]:
    """Yield the listener that suits stderr."""
    if session.quiet or not sys.stderr.isatty():
        yield LineProgress(session)
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}", style="dim", markup=False),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        yield BarProgress(session, progress)


class LineProgress(Listener):
    """One line when a stage starts, one when it ends, and one every few seconds in between."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._head, self._began, self._last = "", 0.0, 0.0
        self._warned: set[str] = set()

    def started(self, number: int, count: int, stage: Stage) -> None:
        self._head, self._began = head(number, count, stage.name), time.monotonic()
        self._last = self._began
        self._session.enter("started", stage=stage.name, number=number, count=count)
        self.show_start(stage)

    def progress(self, fraction: float, text: str) -> None:
        now = time.monotonic()
        if now - self._last >= _SILENCE:
            self._last = now
            left = (now - self._began) * (1 / fraction - 1) if fraction > _GUESSABLE else None
            self._session.enter("progress", fraction=round(fraction, 4), doing=text, left_s=left and round(left, 1))
            self.show_progress(fraction, text, left)

    def warned(self, text: str) -> None:
        self._warned.add(text)
        self._warn(text)  # first, as the log may lie on the disk that does not answer
        self._session.enter("warned", text=text)

    def _warn(self, text: str) -> None:
        self.say(f"         warning: {text}")

    def show_start(self, stage: Stage) -> None:
        """Show that a stage has started."""
        self.say(f"{self._head}  {stage.about}")

    def show_progress(self, fraction: float, text: str, left: float | None) -> None:
        """Show how far the stage is, and how long it will take if it goes on like that [s]."""
        until = f"  (about {left:.0f} s left)" if left is not None else ""
        self.say(f"{self._head}  {100 * fraction:3.0f} %  {text}{until}")

    def ended(self, number: int, count: int, record: StageRecord) -> None:
        self._session.enter("ended", **asdict(record))
        self.say(f"{head(number, count, record.name)}  {end_of(record)}")
        fresh = record.status == "ran"
        for text in record.notes if fresh or self._session.verbose else ():
            self.say(f"         note: {text}")
        for text in record.warnings:
            if text not in self._warned:
                self._warn(text)
        for what, reason in record.left_out if self._session.verbose else ():
            self.say(f"         left out: {what}: {reason}")

    def say(self, text: str) -> None:
        """One line for the user."""
        self._session.say(text)


class BarProgress(LineProgress):
    """A moving bar for the running stage, lines for those that have ended."""

    def __init__(self, session: Session, progress: Progress) -> None:
        super().__init__(session)
        self._progress = progress
        self._task: TaskID | None = None

    def show_start(self, stage: Stage) -> None:
        self._task = self._progress.add_task(self._head, total=1.0, text=stage.about)

    def progress(self, fraction: float, text: str) -> None:
        if self._task is not None:
            self._progress.update(self._task, completed=fraction, text=text)
        super().progress(fraction, text)

    def show_progress(self, fraction: float, text: str, left: float | None) -> None:
        """The bar shows it already."""

    def ended(self, number: int, count: int, record: StageRecord) -> None:
        if self._task is not None:
            self._progress.remove_task(self._task)
            self._task = None
        super().ended(number, count, record)

    def say(self, text: str) -> None:
        self._progress.console.print(text, markup=False, highlight=False, soft_wrap=True)


def head(number: int, count: int, name: str) -> str:
    """Return the position of a stage in the plan: "[ 3/12] garment.stereo"."""
    return f"[{number:>{len(str(count))}}/{count}] {name}"


def end_of(record: StageRecord) -> str:
    """Return how a stage ended."""
    return {
        "ran": f"done in {record.seconds:.1f} s",
        "cached": f"from the cache (originally took {record.seconds:.1f} s)",
        "left_out": f"left out: {record.reason}",
        "failed": f"FAILED after {record.seconds:.1f} s: {record.reason}",
    }.get(record.status, "stopped")
