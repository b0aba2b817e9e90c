"""Read many things one after the other, a few ahead in threads, so that no more than these are in memory."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")


def in_order(read: Callable[[int], T], count: int) -> Iterator[T]:
    """Yield read(0), read(1), ... read(count - 1); what one raises is raised in its turn."""
    threads = os.cpu_count() or 1
    coming: deque[Future[T]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        for index in range(count):
            coming.append(pool.submit(read, index))
            if len(coming) > threads:
                yield coming.popleft().result()
        while coming:
            yield coming.popleft().result()
