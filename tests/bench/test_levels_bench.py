"""What a level takes against the default, in words."""

from __future__ import annotations

from vto_pipeline.bench.scan.levels import shares_in_words
from vto_pipeline.pipeline.levels import DEFAULT, Level


def test_each_share_stands_beside_that_of_the_table():
    level = Level({"px": 1}, {"stereo": 0.5, "openings": 1.3, "texture": 0.9}, 1.4)
    usual = {"garment.stereo": 40.0, "body.stereo": 20.0, "openings": 10.0}
    cpu = {"garment.stereo": 12.0, "body.stereo": 6.0, "openings": 12.5, "texture": 3.0}
    assert shares_in_words(level, cpu, usual) == "stereo 0.30 (0.5), openings 1.25 (1.3)"
    assert shares_in_words(level, cpu, {}) == ""  # the defaults were in the store
    assert shares_in_words(DEFAULT, cpu, usual) == ""
