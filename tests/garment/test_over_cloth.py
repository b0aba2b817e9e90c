"""What closes a notch runs over a gap: a line along the cloth between two gaps does not. Sheets with known gaps."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from vto_pipeline.garment.notches import runs_over_cloth

EDGE = 0.004


def sheet(bend: float) -> tuple[np.ndarray, np.ndarray]:
    """Points of a sheet 0.4 m wide, bent round an upright axis, and of its upper rim: two gaps 0.1 m wide and deep."""
    x, y = np.meshgrid(np.arange(-0.2, 0.2, EDGE), np.arange(-0.3, EDGE / 2, EDGE))
    gap = (np.abs(np.abs(x) - 0.1) < 0.05) & (y > -0.1)
    beside = (np.abs(np.abs(x) - 0.1) < 0.05 + EDGE) & (y > -0.1 - EDGE) & ~gap
    rim = beside | ((y > -EDGE / 2) & ~gap)
    return bent(np.stack([x[~gap], y[~gap], 0.0 * x[~gap]], axis=1), bend), bent(
        np.stack([x[rim], y[rim], 0.0 * x[rim]], axis=1), bend
    )


def bent(points: np.ndarray, bend: float) -> np.ndarray:
    """Roll a plane up by so much [1/m]."""
    if bend == 0.0:
        return points
    angle, radius = bend * points[:, 0], 1.0 / bend + points[:, 2]
    return np.stack([radius * np.sin(angle), points[:, 1], radius * np.cos(angle)], axis=1)


@pytest.mark.parametrize("bend", [0.0, 6.0])
def test_a_line_across_a_gap_is_over_nothing_and_one_below_both_over_cloth(bend: float) -> None:
    cloth, rim = (cKDTree(points) for points in sheet(bend))
    along = np.linspace(0.0, 1.0, 12)[1:-1]
    across = np.stack([0.05 + 0.1 * along, 0.0 * along, 0.0 * along], axis=1)
    assert not runs_over_cloth(bent(across, bend), cloth, rim)
    below = np.stack([0.3 * along - 0.15, -0.2 + 0.0 * along, 0.005 + 0.0 * along], axis=1)  # 5 mm off, 0.1 m under
    assert runs_over_cloth(bent(below, bend), cloth, rim)
