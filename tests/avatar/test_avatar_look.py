"""A heavy body is as smooth as a slim one: no corners, no cones, by plane sections of trimesh."""

import numpy as np
import pytest
import trimesh

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.io.bodies.size_letters import chest_range
from vto_pipeline.model.body import Avatar, Measurements

STEP_M = 0.015


def sized(sex: str, letter: str) -> Avatar:
    tape = {"stature": {"female": 1.66, "male": 1.78}[sex], "chest_girth": sum(chest_range(letter, sex)) / 2}
    return fit_measurements(Measurements(tape, sex=sex))


def lengthwise(body: Avatar, x: float) -> np.ndarray:
    """Segments of the section along the body at x [m], shape (N, 2, 3); just beside it, where no vertex lies."""
    mesh = trimesh.Trimesh(body.bind_vertices, body.faces, process=False)
    return trimesh.intersections.mesh_plane(mesh, [1, 0, 0], [x + 1e-4, 0, 0])


@pytest.mark.parametrize(("sex", "letter"), [("female", "M"), ("female", "4XL"), ("male", "M"), ("male", "4XL")])
def test_shoulders_slope_into_the_arms(sex: str, letter: str) -> None:
    """Seen from the front, the edge from the neck to the arm turns by no more than 12 degrees in 15 mm.

    So it is on three bodies of another model, heavy and average: 10.8, 11.0 and 11.8 degrees.
    """
    body = sized(sex, letter)
    v = body.bind_vertices
    neck, end = (v[body.landmarks[f"left_{name}"], 0] for name in ("side_neck", "shoulder_point"))
    edge = []
    for x in np.arange(neck + 0.03, end + 0.10, STEP_M):
        heights = lengthwise(body, x)[..., 1]
        edge.append(heights[heights < 0.87 * np.ptp(v[:, 1])].max())
    slope = np.degrees(np.arctan(np.diff(edge) / STEP_M))
    assert np.abs(np.diff(slope)).max() < 12


@pytest.mark.parametrize("letter", ["XS", "M", "XL", "4XL"])
def test_no_bust_overhangs(letter: str) -> None:
    """Its underside rises forward by less than 50 degrees from the vertical; an average woman of another model: 62."""
    body = sized("female", letter)
    waist, bust = (body.bind_vertices[body.loops[row], 1].mean() for row in ("waist", "chest"))
    start, end = lengthwise(body, body.bind_vertices[body.landmarks["left_bust_point"], 0]).swapaxes(0, 1)
    front = []
    for y in np.arange(waist + 1e-4, bust, STEP_M):  # beside the rows
        hit = (start[:, 1] - y) * (end[:, 1] - y) < 0
        share = (y - start[hit, 1]) / (end[hit, 1] - start[hit, 1])
        front.append((start[hit, 2] + share * (end[hit, 2] - start[hit, 2])).max())
    assert np.degrees(np.arctan(np.diff(front) / STEP_M)).max() < 50
