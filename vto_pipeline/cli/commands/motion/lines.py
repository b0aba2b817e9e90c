"""What a motion is and how it came out, in a table and as JSON."""

from __future__ import annotations

from typing import Any

from vto_pipeline.avatar.motion.retarget import MotionFigures
from vto_pipeline.cli.tables import table_lines
from vto_pipeline.io.motion.read import MotionFile
from vto_pipeline.model.motion import AvatarMotion

FRAMES_LOOKED_AT = 12
"""Frames in which limbs are held against the body."""


def motion_facts(
    read: MotionFile, motion: AvatarMotion, figures: MotionFigures, crossing: tuple[int, int]
) -> dict[str, Any]:
    """Return what a file holds and how the avatar moves after it, as JSON values; a length's key ends in its unit.

    Args:
        read: The file.
        motion: Of the avatar.
        figures: Of that motion.
        crossing: Frames in which a limb passes through the body, and frames looked at.
    """
    clip = read.clip
    return {
        "dialect": read.dialect,
        "unit": read.axes.unit,
        "up": read.axes.up,
        "frames": len(clip.rotations),
        "frames_per_second": 1.0 / clip.frame_time,
        "seconds": clip.seconds,
        "joints": len(clip.joint_names),
        "names": read.joints.convention,
        "mapped": {ours: clip.joint_names[k] for ours, k in read.joints.indices.items()},
        "avatar_frames": len(motion.poses),
        "avatar_frames_per_second": 1.0 / motion.frame_time,
        "plants": figures.plants,
        "drift_before_mm": 1e3 * figures.drift_before,
        "drift_after_mm": 1e3 * figures.drift_after,
        "spikes_before": figures.spikes_before,
        "spikes_after": figures.spikes_after,
        "below_floor_mm": 1e3 * figures.below_floor,
        "balanced_share": figures.balance.inside_share,
        "limited_share": figures.limited,
        "arms_moved_share": figures.arms_moved,
        "limbs_crossing": list(crossing),
    }


def motion_lines(facts: dict[str, Any]) -> list[str]:
    """Return these facts as a table."""
    share = facts["balanced_share"]
    rows = [
        ("file", facts["dialect"]),
        ("unit, up", f"{facts['unit']}, {facts['up']}"),
        ("frames", f"{facts['frames']} at {facts['frames_per_second']:.4g} a second, {facts['seconds']:.2f} s"),
        ("joints", f"{facts['joints']}, {len(facts['mapped'])} of them mapped by {facts['names']} names"),
        ("avatar's frames", f"{facts['avatar_frames']} at {facts['avatar_frames_per_second']:.4g} a second"),
        ("planted heels and balls", str(facts["plants"])),
        ("their drift", f"{facts['drift_before_mm']:.1f} mm before, {facts['drift_after_mm']:.2f} mm after"),
        ("frames with a jerk", f"{facts['spikes_before']} before, {facts['spikes_after']} after"),
        ("deepest below the floor", f"{facts['below_floor_mm']:.1f} mm"),
        ("zero moment point inside", "no foot on the floor" if share is None else f"{share:.0%} of the frames"),
        ("arms moved off the body", f"{facts['arms_moved_share']:.0%} of the frames"),
        ("limbs through the body", "{} of {} frames looked at".format(*facts["limbs_crossing"])),
    ]
    return table_lines(("", ""), rows)[2:]
