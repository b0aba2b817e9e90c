"""vto motion."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.avatar.template.template import template
from vto_pipeline.io.bodies.avatars import write_avatar
from vto_pipeline.io.motion.archive import read_avatar_motion
from vto_pipeline.io.motion.read import presets, read_motion
from vto_pipeline.io.motion.tracked.lines import LANDMARKS
from vto_pipeline.numerics.kinematics import quaternion_matrices, world_transforms

HEAD = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
"""


def write_walker(path: Path) -> None:
    """Two legs and no more, in centimetres, that stand for three frames."""
    text = HEAD
    for side, x in (("Left", 9), ("Right", -9)):
        for joint, offset in (("UpLeg", f"{x} -5 0"), ("Leg", "0 -41 0"), ("Foot", "0 -40 0")):
            text += f"JOINT {side}{joint}\n{{\nOFFSET {offset}\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        text += "End Site\n{\nOFFSET 0 -8 12\n}\n" + "}\n" * 3
    row = " ".join(["0 94 0", *["0 0 0"] * 7])
    path.write_text(f"{text}}}\nMOTION\nFrames: 4\nFrame Time: 0.04\n{row}\n{row}\nnan {row[2:]}\n{row}\n")


def test_the_help_names_the_presets_that_there_are(vto):
    said = " ".join(vto("motion", "--help").out.split())
    listed = re.search(r"Presets have names: ([a-z_, ]+)\.", said)
    assert sorted(listed[1].split(", ")) == sorted(presets())


def test_a_motion_is_described_and_carried_over(vto):
    write_walker(Path("w.bvh"))
    write_avatar(Path("avatar.npz"), template(0.0))
    said = vto("motion", "w.bvh", "--avatar", "avatar.npz", "-o", "out", "--fps", "50", "--json")
    assert said.code == 0
    data = said.data
    assert (data["unit"], data["up"], data["frames"]) == ("cm", "+Y", 4)
    assert data["frames_per_second"] == pytest.approx(25.0)
    assert data["mapped"]["left_knee"] == "LeftLeg"
    assert data["plants"] == 4
    assert data["drift_after_mm"] < 0.01
    assert data["balanced_share"] == 1.0
    assert any("1 lost frames" in text for text in data["warnings"])
    motion = read_avatar_motion(Path("out/motion.npz"))
    assert len(motion.poses) == 7
    assert motion.frame_time == pytest.approx(0.02)
    assert motion.planted.all()
    np.testing.assert_allclose(read_motion("out/motion.glb").clip.frame_time, 0.02, rtol=1e-6)  # single precision
    lines = vto("motion", "w.bvh", "--lead-in", "0.4s").out
    assert "BVH, rotations ZXY, places on the root" in lines
    assert "22 at 25 a second" in lines  # 10 frames of lead-in; 4 of the clip, 3 more as it slows and 5 as it sets out


def test_presets_have_names_and_mistakes_have_exit_codes(vto):
    said = vto("motion", "sitting", "--json")
    assert said.code == 0
    assert said.data["frames"] == 1
    assert vto("motion", "siting").code == 3
    Path("a.bvh").write_text("HIERARCHY\nROOT a\n{\n")
    said = vto("motion", "a.bvh", "--json")
    assert said.code == 3
    assert "MOTION" in said.data["error"]["problem"]
    Path("file").write_text("")
    assert vto("motion", "sitting", "-o", "file").code == 2
    assert vto("motion", "sitting", "--lead-in", "3").code == 2
    assert vto("motion", "sitting", "--hips-aside", "60").code == 2
    said = vto("motion", "sitting", "--hips-aside", "5m")
    assert (said.code, "hips_aside_mm" in said.err) == (2, True)


def test_hips_move_aside_where_it_is_asked_for(vto):
    aside = ["--hips-aside", "60mm"]
    shares = [vto("motion", "walking_step", "--json", *more).data["balanced_share"] for more in ([], aside)]
    assert shares[0] < shares[1]


def test_joints_come_from_standard_input(vto, monkeypatch):
    step = read_motion("walking_step")
    _, places = world_transforms(step.clip.parents, quaternion_matrices(step.clip.rotations), step.clip.translations)
    joints = {name: places[:, k] for name, k in step.joints.indices.items() if name in LANDMARKS}
    lines = [json.dumps({"joints": {name: place[t].tolist() for name, place in joints.items()}}) for t in range(5)]
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO("\n".join(lines).encode())))
    said = vto("motion", "-", "-o", "live", "--json")
    assert said.code == 0
    assert (said.data["path"], said.data["frames"], said.data["unit"]) == ("-", 5, "m")
    assert len(read_avatar_motion(Path("live/motion.npz")).poses) == 5
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"nonsense")))
    said = vto("motion", "-")
    assert (said.code, "standard_input.jsonl, line 1" in said.err) == (3, True)
