"""How rows go to the workers: a few ahead, in their order, and none once the scheduler is gone."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import ClassVar

import pytest

from vto_pipeline.pipeline.batch import cluster
from vto_pipeline.pipeline.batch.row import RowResult, RowTask

distributed = pytest.importorskip("distributed")


class Future:
    """Of a row that ends as it begins, or is lost with the scheduler."""

    def __init__(self, task: RowTask, is_lost: bool) -> None:
        self.task, self.status = task, "cancelled" if is_lost else "finished"

    def result(self) -> RowResult:
        return RowResult(self.task.name, self.task.key, "done", 0, 1.0, 1.0, 1)


class Client:
    """A cluster of two workers; its scheduler dies after some rows."""

    lives = 1000
    submitted: ClassVar[list[str]] = []
    most = 0

    def __init__(self, *_: object, **__: object) -> None:
        Client.submitted, Client.most = [], 0

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None: ...

    def nthreads(self) -> dict[str, int]:
        return {"a": 1, "b": 1}

    def submit(self, _: object, task: RowTask, **__: object) -> Future:
        Client.submitted.append(task.name)
        return Future(task, len(Client.submitted) > Client.lives)


class AsCompleted:
    """The rows in the order in which they were submitted."""

    def __init__(self) -> None:
        self.waiting: deque[Future] = deque()

    def add(self, future: Future) -> None:
        self.waiting.append(future)
        Client.most = max(Client.most, len(self.waiting))

    def has_ready(self) -> bool:
        return len(self.waiting) > 0

    def __next__(self) -> Future:
        return self.waiting.popleft()


@pytest.fixture
def rows(monkeypatch: pytest.MonkeyPatch) -> list[RowTask]:
    monkeypatch.setattr(distributed, "Client", Client)
    monkeypatch.setattr(distributed, "as_completed", AsCompleted)
    return [RowTask(f"r{i}", "k", ("true",), "run", "log", 1, 1.0, 1.0, 0) for i in range(100)]


def test_a_few_rows_for_each_worker_are_under_way(rows: list[RowTask], tmp_path: Path) -> None:
    results = list(cluster.run_rows(rows, 2, "tcp://there:1", tmp_path))
    assert [one.name for one in results] == Client.submitted == [task.name for task in rows]
    assert {one.status for one in results} == {"done"}
    assert 4 <= Client.most <= 8  # of a hundred; two workers, each with one at work


def test_rows_are_lost_with_the_scheduler_and_not_handed_in(
    rows: list[RowTask], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Client, "lives", 10)
    results = list(cluster.run_rows(rows, 2, "tcp://there:1", tmp_path))
    assert [one.name for one in results] == [task.name for task in rows]
    assert [one.status for one in results] == ["done"] * 10 + ["lost"] * 90
    assert len(Client.submitted) < 20
