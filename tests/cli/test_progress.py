"""What a run shows while it works."""

from __future__ import annotations

import io

from rich.console import Console
from rich.progress import Progress
from toy_tables import STAGES

from vto_pipeline.cli import progress as progress_module
from vto_pipeline.cli.progress import BarProgress, LineProgress
from vto_pipeline.cli.session import Session
from vto_pipeline.pipeline.execution.record import StageRecord


def test_plain_lines_are_throttled(monkeypatch, capsys):
    now = [100.0]
    monkeypatch.setattr(progress_module.time, "monotonic", lambda: now[0])
    lines = LineProgress(Session())
    lines.started(3, 12, STAGES[2])
    for second in range(1, 13):
        now[0] = 100.0 + second
        lines.progress(second / 12, f"pair {second} of 12")
    lines.ended(3, 12, StageRecord("add", "ran", seconds=12.0, warnings=["poor"]))
    assert capsys.readouterr().err.splitlines() == [
        "[ 3/12] add  the sum",
        "[ 3/12] add   42 %  pair 5 of 12  (about 7 s left)",
        "[ 3/12] add   83 %  pair 10 of 12  (about 2 s left)",
        "[ 3/12] add  done in 12.0 s",
        "         warning: poor",
    ]


def test_what_cannot_wait_is_shown_at_once_and_only_once(capsys):
    lines = LineProgress(Session())
    lines.started(1, 2, STAGES[0])
    lines.warned("too short")
    assert capsys.readouterr().err.splitlines()[-1] == "         warning: too short"
    lines.ended(1, 2, StageRecord("left.double", "ran", seconds=1.0, warnings=["too short", "poor"]))
    assert capsys.readouterr().err.splitlines() == ["[1/2] left.double  done in 1.0 s", "         warning: poor"]


def test_bars_leave_one_line_per_stage():
    page = io.StringIO()
    with Progress(console=Console(file=page, width=100, force_terminal=False), transient=True) as progress:
        bars = BarProgress(Session(), progress)
        bars.started(1, 2, STAGES[0])
        bars.progress(0.5, "half [way]")
        assert [task.completed for task in progress.tasks] == [0.5]
        bars.ended(1, 2, StageRecord("left.double", "failed", "blew up", 1.0))
        assert not progress.tasks
    assert "[1/2] left.double  FAILED after 1.0 s: blew up" in page.getvalue()
