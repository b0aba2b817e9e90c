"""The command line on the toy tables."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from batch_processes import client, cluster, gate, new_cluster  # noqa: F401  # fixtures
from toy_tables import CALLS, TOY

from vto_pipeline.cli.main import main
from vto_pipeline.stages.entry import planning


class Said(NamedTuple):
    """What a command line left behind."""

    code: int
    out: str
    err: str

    @property
    def data(self) -> Any:
        """The one JSON document on stdout."""
        return json.loads(self.out)


@pytest.fixture
def vto(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Callable[..., Said]:
    """Call `vto` with the toy tables, in a folder with toy.yaml, left.txt (3) and right.txt (4)."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")  # of tables, whatever the terminal
    monkeypatch.setattr(planning, "catalogue", lambda: TOY)
    (tmp_path / "left.txt").write_text("3")
    (tmp_path / "right.txt").write_text("4")
    (tmp_path / "toy.yaml").write_text(
        "schema: 1\n"
        "given:\n"
        "  left: {number: left.txt}\n"
        "  right: {number: right.txt}\n"
        "want: [squared, label, page]\n"
        "stages:\n"
        "  add: {offset: 0}\n"
    )

    def call(*arguments: object) -> Said:
        CALLS.clear()
        capfd.readouterr()
        code = main([str(argument) for argument in arguments])
        return Said(code, *capfd.readouterr())

    return call
