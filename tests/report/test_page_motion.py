"""A motion on the page: frames come back from what is packed, and a browser shows them."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
from report_parts import all_parts, run_record, tube

from vto_pipeline.model.motion import ClothMotion
from vto_pipeline.report.page import build_page
from vto_pipeline.report.verdicts import collect_verdicts
from vto_pipeline.stages.motion import shown_motion

TIMES = np.arange(20) * 0.05  # s


def swaying(radius: float, low: float, high: float) -> ClothMotion:
    """A tube that bends to its left, and back, while folds of 10 mm run over it."""
    still = tube(radius, low, high)
    sway = np.sin(np.pi * TIMES)[:, None] * (still.vertices[:, 1] / 1.8) ** 2
    frames = np.repeat(still.vertices[None], len(TIMES), axis=0)
    frames[:, :, 0] += 0.6 * sway
    frames[:, :, 2] += 0.01 * np.sin(20 * still.vertices[:, 1] - 15 * TIMES[:, None])
    return ClothMotion(frames, still.faces, 0.05)


@pytest.fixture(scope="module")
def parts() -> dict:
    return {**all_parts(), "motion": (swaying(0.18, 0.8, 1.5), swaying(0.15, 0.0, 1.8))}


def scene_of(page: str) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="scene">(.*?)</script>', page, re.S)[1])


def frames_of(packed: dict) -> np.ndarray:
    """What the viewer adds up [m], shape (T, V, 3)."""
    grid = np.frombuffer(base64.b64decode(packed["positions"]), "<u2").reshape(-1, 4)[:, :3]
    mean = np.array(packed["low"]) + np.array(packed["size"]) * grid / 65535
    shapes = [np.frombuffer(base64.b64decode(one), "<i2").reshape(-1, 3) for one in packed["shapes"]]
    return mean + packed["step"] * np.einsum("tk,kvd->tvd", np.array(packed["weights"]), np.array(shapes, float))


def test_frames_come_back_to_a_millimetre(parts):
    scene = scene_of(build_page(run_record(), parts))
    assert scene["frameTime"] == pytest.approx(0.05)
    moving = {layer["name"]: layer["geometry"] for layer in scene["layers"] if "motion" in layer["name"]}
    assert set(moving) == {"Garment in motion", "Body in motion"}
    for name, told in zip(moving, parts["motion"], strict=True):
        packed = scene["geometries"][moving[name]]
        off = np.linalg.norm(frames_of(packed) - told.frames, axis=2)
        assert off.max() < 1.1e-3
        assert len(packed["shapes"]) == 3  # it sways, and a running fold is two that stand
        low, high = told.frames.min(axis=(0, 1)), told.frames.max(axis=(0, 1))
        np.testing.assert_allclose(packed["low"], low, atol=1e-9)
        np.testing.assert_allclose(np.add(packed["low"], packed["size"]), high, atol=1e-9)


def test_what_moves_is_hidden_at_first_and_shares_one_geometry(parts):
    stretched = {"motion_maps": {"stretch": np.full(parts["motion"][0].frames.shape[1], 1.12)}}
    layers = scene_of(build_page(run_record(), {**parts, **stretched}))["layers"]
    by_name = {layer["name"]: layer for layer in layers}
    assert not any(layer["visible"] for name, layer in by_name.items() if "motion" in name)
    assert by_name["Most stretch in motion"]["geometry"] == by_name["Garment in motion"]["geometry"]
    assert by_name["Most stretch in motion"]["legend"]["unit"] == "%"


def test_a_page_without_motion_has_no_slider(parts):
    assert '<input type="range"' in build_page(run_record(), parts)
    assert '<input type="range"' not in build_page(run_record(), all_parts())
    assert scene_of(build_page(run_record(), all_parts()))["frameTime"] is None


def test_a_long_motion_is_thinned_out():
    from vto_pipeline.avatar.template.template import template
    from vto_pipeline.model.motion import AvatarMotion

    avatar, count = template(0.0), 601
    joints = len(avatar.joint_names)
    places = np.zeros((count, 3))
    places[:, 2] = np.linspace(0.0, 6.0, count)
    motion = AvatarMotion(avatar.joint_names, np.zeros((count, joints, 3)), places, np.zeros((count, 4), bool), 0.01)
    still = tube(0.2, 1.0, 1.4, 12, 5)
    cloth = ClothMotion(still.vertices + places[:, None], still.faces, 0.01)
    shown, body = shown_motion(cloth, avatar, motion)
    assert len(shown.frames) == len(body.frames) == 121
    assert shown.frame_time == body.frame_time == pytest.approx(0.05)
    for k in (0, 60, 120):
        np.testing.assert_allclose(shown.frames[k], cloth.frames[5 * k])
        np.testing.assert_allclose(body.frames[k][:, 2].mean() - body.frames[0][:, 2].mean(), 0.05 * k, atol=1e-9)


@pytest.mark.parametrize(("most", "tone"), [(0.04, "good"), (0.2, "warn")])
def test_what_is_said_of_motion_and_poses_stands_at_the_top(most, tone):
    report = {"stretch_limit": 0.05, "parts": {"waist": {"most": most}}, "verdict": "in motion: so"}
    poses = [{"reached": False, "stretch_limit": 0.05, "verdict": "sitting: not reached"}]
    poses += [{"reached": True, "stretch_limit": 0.05, "parts": {"waist": {"p95": most}}, "verdict": "step: so"}]
    found = collect_verdicts({"stages": []}, {"motion_report": report, "pose_report": {"poses": poses}})
    assert [(one.tone, one.text) for one in found] == [
        ("bad", "sitting: not reached"),
        (tone, "in motion: so"),
        (tone, "step: so"),
    ]


def test_a_browser_shows_the_frame_that_its_address_names(parts, tmp_path: Path):
    browser = pytest.importorskip("test_page_in_browser")
    if browser.BROWSER is None:
        pytest.skip("no Chromium on this machine")
    still, said = browser.photograph(tmp_path, parts, *browser.SOFTWARE_WEBGL, at="#t=0")
    swayed, more = browser.photograph(tmp_path, parts, *browser.SOFTWARE_WEBGL, at="#t=0.5")
    assert said == more == []

    def blue(pixels: np.ndarray) -> np.ndarray:
        found = (pixels[..., 2] > 1.3 * pixels[..., 0]) & (pixels[..., 2] > 90)
        found[:250] = found[700:] = False  # the view, not the buttons
        return np.argwhere(found)

    assert min(len(blue(still)), len(blue(swayed))) > 2_000
    assert blue(swayed)[:, 1].mean() - blue(still)[:, 1].mean() > 10  # to its left is to the right
