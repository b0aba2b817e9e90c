"""How a garment followed a motion, in words."""

from __future__ import annotations

from vto_pipeline.cli.results import motion_lines

COUNTS = (
    *("frames", "frames_crossing_body", "frames_crossing_itself", "frames_body_crossing_itself", "body_yields_mm"),
    "frames_overstretched",
)
SIZES = ("penetration_mm", "max_thread_stretch", "p99_thread_stretch", "max_shear_deg", "seconds_per_frame")


def last_line(**beyond: float | None) -> str:
    return list(motion_lines(dict.fromkeys((*COUNTS, *SIZES), 0) | {"beyond_limits": beyond}))[-1].strip()


def test_what_is_beyond_the_fabric_is_told_and_what_is_not_known_too():
    told = "cloth beyond what its fabric is known to bear, at most in a frame: "
    found = last_line(warp=0.012, weft=0.0, shear=None)
    assert found == told + "1.2% by its warp, 0.0% by its weft, not known of shear"
    assert last_line(warp=None, weft=None, shear=None) == told + "not known of warp and weft and shear"
    found = last_line(warp=0.5, weft=0.25, shear=0.0)
    assert found == told + "50.0% by its warp, 25.0% by its weft, 0.0% by its shear"


def test_frames_stretched_as_no_cloth_can_be_are_told():
    found = dict.fromkeys((*COUNTS, *SIZES), 0) | {"beyond_limits": {}}
    assert not [line for line in motion_lines(found) if "as no cloth can be" in line]
    (told,) = [
        line for line in motion_lines(found | {"frames_overstretched": 3, "max_stretch": 1.75}) if "as no cloth" in line
    ]
    assert told.strip() == (
        "stretched as no cloth can be in 3 frames, an edge by up to 175%: too small for this motion, or caught"
    )
