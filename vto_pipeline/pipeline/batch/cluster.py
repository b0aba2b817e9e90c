"""All rows of a batch on the workers of dask.distributed: here, or wherever a scheduler is."""

from __future__ import annotations

import logging
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from vto_pipeline.errors import BatchError, ConfigError, MissingDependencyError
from vto_pipeline.pipeline.batch.row import RowResult, RowTask, run_row

_GONE = "the scheduler is gone"
_ALONE = "the scheduler has had no worker for {:.0f} s"
_PATIENCE = 300.0  # s without any worker: machines that are started on demand take minutes
_LOOK = 0.1  # s between looks at whether a row has ended
_COUNT = 1.0  # s between questions for the workers
_EACH = 3  # rows that a worker has or waits for
_LEAST_WINDOW = 4  # also before the first worker has come
_SHARE_OF_MEMORY = 0.8  # of the machine's that rows may take together
_QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
}
"""Workers and scheduler look after themselves up to a hundred times a second: a share of the cores that rows want."""


def default_workers(memory_mb: float) -> int:
    """Return how many rows run at once: one a core, as far as memory goes.

    Args:
        memory_mb: Limit of each [MB].
    """
    present = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e6
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(cores, int(_SHARE_OF_MEMORY * present / memory_mb)))


def run_rows(
    tasks: Sequence[RowTask],
    workers: int,
    scheduler: str | None,
    scratch: Path,
    say: Callable[[str], None] = lambda text: None,
) -> Iterator[RowResult]:
    """Run all rows, and yield what becomes of each as soon as it ends.

    Args:
        tasks: In the order in which they begin.
        workers: How many run at once on this machine, where there is no scheduler.
        scheduler: Address of one, whose workers have this package and see the same folders; None: this machine.
        scratch: Folder for the workers' own files.
        say: Takes a line where the rows wait for a worker.

    Raises:
        MissingDependencyError: no dask.distributed; ConfigError: no scheduler answers; BatchError: the workers here do
            not start.
    """
    try:
        import dask
        from distributed import Client, LocalCluster, as_completed
    except ImportError:
        raise MissingDependencyError(
            "batches need dask.distributed", hint="pip install 'vto-pipeline[batch]'"
        ) from None
    logging.getLogger("distributed").setLevel(logging.WARNING)
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # a scheduler that is gone is told row by row
    logging.getLogger("distributed.nanny").setLevel(logging.ERROR)  # and so is a worker
    with ExitStack() as stack:
        stack.enter_context(dask.config.set(_QUIET))
        try:
            address: Any = scheduler or stack.enter_context(
                LocalCluster(
                    n_workers=min(workers, len(tasks)),
                    threads_per_worker=1,
                    memory_limit=0,  # rows are processes of their own, with limits of their own
                    dashboard_address=":0",  # any free port: two batches do not meet
                    local_directory=str(scratch),
                    silence_logs=logging.ERROR,  # of rows that are cancelled it would tell with their traces
                )
            )
        except RuntimeError as error:
            raise BatchError(f"the workers did not start: {error}", hint="run the same command again") from None
        try:
            client = stack.enter_context(Client(address, timeout="20s"))
        except (OSError, TimeoutError, ValueError) as error:
            raise ConfigError(f"no scheduler answers: {error}", where=str(scheduler)) from None
        waiting = deque(tasks)
        futures: dict[Any, RowTask] = {}
        ended = as_completed()
        while waiting or futures:
            while waiting and len(futures) < _window(client):
                task = waiting.popleft()
                try:
                    future = client.submit(run_row, task, key=f"{task.name}-{task.key}", pure=False)
                except Exception:  # its class differs by version and moment; a client that has closed takes nothing
                    yield from (_lost(one, _GONE) for one in [*futures.values(), task, *waiting])
                    return
                futures[future] = task
                ended.add(future)
            if not _has_ended(ended, client, say):
                yield from (_lost(task, _ALONE.format(_PATIENCE)) for task in [*futures.values(), *waiting])
                return
            future = next(ended)
            result = _result(future, futures.pop(future))
            yield result
            if result.problem == _GONE:
                yield from (_lost(task, _GONE) for task in [*futures.values(), *waiting])
                return


def _has_ended(ended: Any, client: Any, say: Callable[[str], None]) -> bool:
    """Wait until a row has ended, or return False where there has been no worker to run one for too long."""
    since, asked = time.monotonic(), 0.0
    is_told = False
    while not ended.has_ready():
        now = time.monotonic()
        if now - asked >= _COUNT:
            asked = now
            if _slots(client) != 0:
                since = now
            elif not is_told:
                start = f"dask worker {client.scheduler.address}"
                say(f"the scheduler has no worker; waiting up to {_PATIENCE:.0f} s for one: `{start}` starts it")
                is_told = True
        if now - since >= _PATIENCE:
            return False
        time.sleep(_LOOK)
    return True


def _window(client: Any) -> int:
    """Return how many rows the workers hold at once, so that each has its next; as many have joined by now."""
    return max(_LEAST_WINDOW, _EACH * (_slots(client) or 0))


def _slots(client: Any) -> int | None:
    """Return how many rows the workers can run at once; None where the scheduler is gone, as the rows it had tell."""
    with suppress(Exception):  # its class differs by moment, as below
        return sum(client.nthreads().values())
    return None


def _result(future: Any, task: RowTask) -> RowResult:
    """Return what became of a row whose future has ended."""
    problem = _GONE
    if future.status == "finished":
        with suppress(Exception):  # `run_row` raises none, but what it returned can still be lost on its way here
            result: RowResult = future.result()
            return result
    elif future.status != "cancelled":
        problem = _problem(future.exception())
    return _lost(task, problem)


def _lost(task: RowTask, problem: str) -> RowResult:
    return RowResult(task.name, task.key, "lost", -9, 0.0, 0.0, 1, problem)


def _problem(error: BaseException) -> str:
    """Return why a worker gave no result."""
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        return "each worker that it ran on has died"
    return f"its worker could not run it: {error}"
