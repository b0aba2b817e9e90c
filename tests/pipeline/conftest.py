"""Documents and runs on the toy tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from toy_levels import Machine
from toy_tables import CALLS, TOY

from vto_pipeline.io.documents import load_yaml
from vto_pipeline.pipeline.execution.listener import Listener
from vto_pipeline.pipeline.execution.run import run
from vto_pipeline.pipeline.plan import make_plan
from vto_pipeline.pipeline.request import Request, read_request


@pytest.fixture
def ask(tmp_path: Path) -> Callable[..., Request]:
    """Write a document beside left.txt (3) and right.txt (4), and check it."""

    def ask(text: str, overrides: Sequence[str] = ()) -> Request:
        for name, value in (("left.txt", "3"), ("right.txt", "4")):
            if not (tmp_path / name).exists():
                (tmp_path / name).write_text(value)
        path = tmp_path / "toy.yaml"
        path.write_text(text)
        return read_request(load_yaml(path), tmp_path, TOY, overrides)

    return ask


@pytest.fixture
def go(ask: Callable[..., Request], tmp_path: Path) -> Callable[..., dict[str, Any]]:
    """Run a document in tmp_path/run; CALLS then holds the stages that really ran."""

    def go(text: str, overrides: Sequence[str] = (), force_all: bool = False) -> dict[str, Any]:
        request = ask(text, overrides)
        CALLS.clear()
        return run(request, make_plan(request, TOY), TOY, tmp_path / "run", force_all=force_all, listener=Listener())

    return go


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    """Runs the toy table of stages with levels, on a clock of its own."""
    return Machine(tmp_path, monkeypatch)
