"""One dressed form for all tests of this room: making it takes seconds."""

from __future__ import annotations

import dressed_form
import pytest


@pytest.fixture(scope="session")
def scene():
    return dressed_form.make_scene(cell=0.008, motion=dressed_form.rigid([5, 140, 3], [0.3, 0.1, -0.5]))
