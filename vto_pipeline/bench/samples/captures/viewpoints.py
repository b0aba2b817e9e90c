"""Positions and targets of the cameras."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray


def looking_at(eye: FloatArray, target: FloatArray) -> FloatArray:
    """world_from_cam of an upright camera, shape (4, 4)."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(forward, right), forward, eye
    return pose


def on_ring(distance: float, elevation_deg: float, azimuth_deg: float, target: FloatArray) -> FloatArray:
    """A camera at a distance from `target` [m] that looks at it; azimuth 0 is in front (+Z); shape (4, 4)."""
    up, round_ = np.deg2rad(elevation_deg), np.deg2rad(azimuth_deg)
    away = np.array([np.sin(round_) * np.cos(up), np.sin(up), np.cos(round_) * np.cos(up)])
    return looking_at(target + distance * away, target)
