"""Listener to the progress of a run."""

from __future__ import annotations

from vto_pipeline.pipeline.execution.record import StageRecord
from vto_pipeline.pipeline.stage import Stage


class Listener:
    """Receives the progress of a run. This one ignores it."""

    def started(self, number: int, count: int, stage: Stage) -> None:
        """A stage starts, as it is not in the cache."""

    def progress(self, fraction: float, text: str) -> None:
        """The running stage has done a share of its work, 0 to 1, and now does `text`."""

    def warned(self, text: str) -> None:
        """Something is said that cannot wait until the stage has ended. It may come from another thread."""

    def ended(self, number: int, count: int, record: StageRecord) -> None:
        """A stage has ended, whichever way."""
