"""Marks the tests that hand a reader something made bad, so that `pytest -m bad_file` counts and runs them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

HERE = Path(__file__).parent
REFUSALS = {"InputError", "FormatError", "ConfigError"}


def pytest_collection_modifyitems(items: Iterable[pytest.Function]) -> None:
    """Mark each test of a reader here that expects a refusal: its code asks for one by name."""
    for item in items:
        if item.path.is_relative_to(HERE):
            named = set(item.function.__code__.co_names)
            if "raises" in named and named & REFUSALS:
                item.add_marker("bad_file")
