"""Who is told how a run goes."""

from __future__ import annotations

from vto_pipeline.pipeline.record import StageRecord
from vto_pipeline.pipeline.stage import Stage


class Listener:
    """Told how a run goes. This one keeps it to itself."""

    def started(self, number: int, count: int, stage: Stage) -> None:
        """A stage begins to work: it is not in the cache."""

    def progress(self, fraction: float, text: str) -> None:
        """The running stage has done a share of its work, 0 to 1, and is at `text`."""

    def ended(self, number: int, count: int, record: StageRecord) -> None:
        """A stage has ended, whichever way."""
