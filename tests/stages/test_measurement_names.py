"""What a tape's protocol may name and what the avatar can measure are two tables in two rooms: they must agree."""

import pytest

from vto_pipeline.avatar.measuring.definitions import DEFINITIONS, definition
from vto_pipeline.io.bodies.measurements import MEASUREMENT_NAMES


def test_everything_the_avatar_measures_can_be_written_and_read() -> None:
    assert set(DEFINITIONS) <= MEASUREMENT_NAMES


@pytest.mark.parametrize("name", sorted(MEASUREMENT_NAMES))
def test_everything_a_tape_may_name_is_defined(name: str) -> None:
    assert definition(name).name in DEFINITIONS
