"""What happens in a child process, well or badly, comes back as arrays or as one error."""

from __future__ import annotations

import ctypes
import os
import resource
import time
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.sandbox import run_limited


def square(count: int) -> Arrays:
    return {"values": np.arange(count) ** 2}


def refuse(problem: str) -> Arrays:
    raise InputError(problem, where="a place", hint="an advice")


def write_much(bytes_: int) -> Arrays:
    Path("much").write_bytes(b"0" * bytes_)
    return {}


def count_forever(start: int) -> Arrays:
    while True:
        start += 1


def kept_waiting(seconds: float) -> Arrays:
    time.sleep(seconds)
    return {"values": np.array([1])}


def return_an_object() -> Arrays:
    return {"values": np.array([object()])}


def test_arrays_come_back() -> None:
    assert run_limited(square, 4)["values"].tolist() == [0, 1, 4, 9]


def test_a_refusal_keeps_its_class_and_fields() -> None:
    with pytest.raises(InputError) as caught:
        run_limited(refuse, "a problem")
    error = caught.value
    assert (type(error), error.problem, error.where, error.hint) == (InputError, "a problem", "a place", "an advice")


def test_a_segmentation_fault_is_a_format_error() -> None:
    with pytest.raises(FormatError, match="the reader crashed \\(signal 11\\)"):
        run_limited(ctypes.string_at, 0, where="x.ply")


def test_a_success_without_an_answer_is_a_format_error() -> None:
    with pytest.raises(FormatError, match="the reader failed: exit code 0"):
        run_limited(os._exit, 0)


def test_too_much_memory_is_a_format_error() -> None:
    with pytest.raises(FormatError, match="more than 512 MB of memory"):
        run_limited(bytearray, 2**30, memory_bytes=2**29)


def test_too_much_processor_time_is_a_format_error() -> None:
    start = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    with pytest.raises(FormatError, match="longer than 1 s of processor time"):
        run_limited(count_forever, 0, seconds=1.0)
    assert 0.5 < resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - start < 2.5  # s: some of it is the system's


def test_a_reader_that_only_waits_is_a_format_error() -> None:
    start = time.monotonic()
    with pytest.raises(FormatError, match="not ended after 10 s"):
        run_limited(time.sleep, 60, seconds=1.0)
    assert 9.5 < time.monotonic() - start < 50.0  # s: the limit of 10 s, and a busy machine; one waits for 60 s


def test_time_in_which_others_have_the_processor_does_not_count() -> None:
    assert run_limited(kept_waiting, 2.5, seconds=1.0)["values"].tolist() == [1]


def test_too_large_a_file_is_a_format_error() -> None:
    with pytest.raises(FormatError, match="File too large"):
        run_limited(write_much, 2_000_000, file_bytes=1_000_000)


def test_an_exception_of_a_parser_is_a_format_error_with_its_text() -> None:
    with pytest.raises(FormatError, match="the reader failed: ZeroDivisionError") as caught:
        run_limited(divmod, 1, 0, where="x.ply")
    assert caught.value.where == "x.ply"


def test_no_object_crosses_the_border() -> None:
    with pytest.raises(FormatError, match="Object arrays cannot be saved"):
        run_limited(return_an_object)
