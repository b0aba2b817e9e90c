"""Frames as few bytes: what comes out is what went in, to half a step of the grid, whatever was lost on the way."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import FormatError
from vto_pipeline.report.live.codec import KEY, STEP_M, Encoder, decode

STATED = 0.125e-3  # m along each axis, as the docs say
ROUNDING = 1e-9  # m: of a place some hundred kilometres away


def frames(seed: int, count: int, vertices: int, spread: float, leap: float, away: float) -> np.ndarray:
    """A cloud that wanders, shape (T, V, 3)."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(-spread / 2, spread / 2, (vertices, 3)) * 0.99
    steps = rng.normal(0.0, 1.0, (count, 1, 3)) * leap + rng.normal(0.0, 1e-3, (count, vertices, 3)) * (spread < 15)
    return rng.normal(0.0, away, 3) + start + np.cumsum(steps, axis=0)


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 6),
    vertices=st.integers(1, 40),
    spread=st.sampled_from([0.0, 0.3, 2.0, 15.9]),
    leap=st.sampled_from([0.0, 0.01, 1.0, 30.0]),
    away=st.sampled_from([0.0, 5.0, 1e5]),
)
@settings(deadline=None, max_examples=150)
def test_every_frame_arrives_to_half_a_step(seed, count, vertices, spread, leap, away):
    encoder, last = Encoder(), None
    for number, places in enumerate(frames(seed, count, vertices, spread, leap, away)):
        last = decode(encoder.encode(places).change(), last)
        assert last[0] == number
        assert_allclose(last[1] * STEP_M, places, rtol=0, atol=STATED + ROUNDING)


@given(seed=st.integers(0, 2**32 - 1), lost=st.sets(st.integers(0, 9)))
@settings(deadline=None, max_examples=50)
def test_after_a_loss_a_key_brings_all_back_and_a_change_is_refused(seed, lost):
    encoder, last = Encoder(), None
    for number, places in enumerate(frames(seed, 10, 20, 1.0, 0.02, 0.0)):
        frame = encoder.encode(places)
        if number in lost:
            continue
        if number and (last is None or last[0] != number - 1):
            with pytest.raises(FormatError, match="does not follow"):
                decode(frame.change(), last)
            last = decode(frame.key(), last)
        else:
            last = decode(frame.change(), last)
        assert_array_equal(last[1], frame.grid)


def test_a_change_is_much_smaller_than_a_key_and_the_key_than_single_precision():
    """A body's surface that goes along by millimetres: as the frames of a stream do."""
    rng = np.random.default_rng(1)
    places = rng.uniform(-1, 1, (5000, 3))
    encoder = Encoder()
    encoder.encode(places)
    frame = encoder.encode(places + rng.normal(0.0, 1e-3, places.shape))
    assert len(frame.change()) < 0.55 * len(frame.key())
    assert len(frame.key()) < 0.55 * 4 * places.size


def test_a_leap_beyond_16_bits_is_a_key():
    encoder = Encoder()
    encoder.encode(np.zeros((3, 3)))
    assert encoder.encode(np.full((3, 3), 2**15 * STEP_M)).change()[0] == KEY
    assert encoder.encode(np.full((3, 3), 2**15 * STEP_M + 1.0)).change()[0] != KEY


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e9, 16.4])
def test_what_no_frame_can_say_is_refused(bad):
    with pytest.raises(FormatError, match="not finite, or farther apart"):
        Encoder().encode(np.array([[0.0, 0.0, 0.0], [0.0, bad, 0.0]]))


@given(st.binary(max_size=60))
def test_bytes_that_are_no_frame_are_refused(data):
    with pytest.raises(FormatError):
        decode(data, None)
