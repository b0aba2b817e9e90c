"""The limits of ISO 20685, for comparison.

They are limits on the mean error of a group of at least some dozens of people, scan less hand, and not on one person:
no single fit conforms to them. Figures as restated by Kouchi in Gupta and Zakaria (eds), Anthropometry, Apparel Sizing
and Design, p. 41; which of our measurements belongs to which class is our reading.
"""

from __future__ import annotations

LIMITS_MM = {
    "segment lengths": 5.0,
    "body heights": 4.0,
    "large girths": 9.0,
    "small girths": 4.0,
    "body breadths": 4.0,
    "body depths": 5.0,
}
"""Class -> largest mean error of a group [mm]."""

CLASSES = {
    "segment lengths": ("shoulder_length", "outer_arm_length", "back_neck_to_waist"),
    "body heights": ("stature", "back_neck_height", "waist_height", "hip_height", "inside_leg", "knee_height"),
    "large girths": ("chest_girth", "underbust_girth", "waist_girth", "hip_girth", "thigh_girth"),
    "small girths": (
        "neck_girth",
        "neck_base_girth",
        "upper_arm_girth",
        "forearm_girth",
        "wrist_girth",
        "knee_girth",
        "calf_girth",
        "ankle_girth",
    ),
    "body breadths": ("waist_breadth", "hip_breadth", "back_shoulder_width"),
    "body depths": ("chest_depth", "waist_depth", "hip_depth"),
}
"""Class -> our measurements in it."""
