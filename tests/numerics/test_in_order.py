"""Reading ahead: in order, and never far."""

from __future__ import annotations

import os
import threading

import pytest

from vto_pipeline.numerics.cpu_threads import in_order


def test_results_come_in_order_and_few_are_read_ahead():
    lock, read = threading.Lock(), []

    def square(k):
        with lock:
            read.append(k)
        return k * k

    ahead = []
    for k, value in enumerate(in_order(square, 200)):
        assert value == k * k
        ahead.append(len(read) - k)
    assert len(read) == 200
    assert max(ahead) <= (os.cpu_count() or 1) + 2


def test_an_error_comes_in_its_turn():
    def fails_at_three(k):
        if k == 3:
            raise ValueError("three")
        return k

    values = in_order(fails_at_three, 6)
    assert [next(values) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="three"):
        next(values)
