"""BVH in every dialect, against places by homogeneous matrices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motion_shapes import NAMES, bvh_text, random_moves, write_bvh
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.motion.bvh import parse_bvh
from vto_pipeline.io.motion.read import read_motion, understood
from vto_pipeline.model.job import Job
from vto_pipeline.numerics.kinematics import quaternion_matrices, world_transforms

REAL = Path(__file__).parents[2].parent / "shared" / "data" / "motion"


def read(path: Path, **options):
    """Read without the child process, which has tests of its own."""
    job = Job()
    arrays = parse_bvh(str(path))
    for text in arrays["warnings"]:
        job.warn(str(text))
    return understood(arrays, path, options.get("unit"), options.get("up"), job), job


def world_places(clip) -> np.ndarray:
    """Places of the joints that are no end sites, in the order of the file."""
    _, places = world_transforms(clip.parents, quaternion_matrices(clip.rotations), clip.translations)
    return places[:, [clip.joint_names.index(name) for name in NAMES]]


@pytest.mark.parametrize(
    ("options", "unit"),
    [
        ({"order": "ZXY", "metres": 0.01}, "cm"),
        ({"order": "XYZ", "metres": 0.01, "newline": "\r\n"}, "cm"),
        ({"order": "ZYX", "metres": 0.0254 / 0.45, "indent": "  "}, "CMU's"),
        ({"order": "YXZ", "metres": 0.0254}, "in"),
        ({"order": "XYZ", "metres": 0.1, "z_up": True}, "dm"),
        ({"order": "YZX", "metres": 1.0, "places": "all"}, "m"),
        ({"order": "XZY", "metres": 0.001, "places": "all_zero", "z_up": True}, "mm"),
    ],
)
def test_every_dialect_gives_the_same_places(tmp_path, options, unit):
    moves = random_moves()
    found, _ = read(write_bvh(tmp_path / "a.bvh", moves, **options))
    assert found.axes.unit == unit
    assert found.axes.up == ("+Z" if options.get("z_up") else "+Y")
    assert found.clip.frame_time == pytest.approx(1 / 30, abs=1e-6)
    # eight digits of degrees and nine of units in the file
    np.testing.assert_allclose(world_places(found.clip), moves.places(), rtol=0, atol=1e-6)
    assert len(found.joints.indices) == 21


def test_a_joint_with_two_turns_is_read(tmp_path):
    text = bvh_text(random_moves(1), order="ZXY").replace("Zrotation Xrotation Yrotation", "Zrotation Yrotation")
    text = text.replace("CHANNELS 6", "CHANNELS 5").replace("CHANNELS 3", "CHANNELS 2")
    head, _ = text.split("Frame Time")
    values = [0.0, 95.0, 0.0, *[0.0] * (2 * len(NAMES))]
    values[3:5] = [30.0, 20.0]
    (tmp_path / "a.bvh").write_text(f"{head}Frame Time: .0333\n{' '.join(map(str, values))}\n")
    found, _ = read(tmp_path / "a.bvh")
    truth = Rotation.from_euler("ZY", [30.0, 20.0], degrees=True).as_matrix()
    np.testing.assert_allclose(quaternion_matrices(found.clip.rotations)[0, 0], truth, rtol=0, atol=1e-12)


def spinning(frames: int):
    """A left elbow that turns at a constant rate, so that a lost frame has a true value."""
    moves = random_moves(1)
    turns = np.repeat(moves.turns, frames, axis=0)
    elbow = NAMES.index("LeftForeArm")
    turns[:, elbow] = Rotation.from_euler("Y", -np.arange(frames)[:, None] * 7.0, degrees=True).as_matrix()
    root = moves.root + np.arange(frames)[:, None] * [0.01, 0.0, 0.02]
    return type(moves)(turns, root)


@pytest.mark.parametrize("damage", ["nan", "-1.#IND00", "1.#QNAN", "1.#INF", "-nan(ind)", "short", "huge"])
def test_lost_frames_are_filled_and_said(tmp_path, damage):
    moves = spinning(9)
    lines = bvh_text(moves).splitlines()
    first = len(lines) - 9
    for lost in (first + 3, first + 4):
        words = lines[lost].split()
        lines[lost] = {
            "short": " ".join(words[:20]),
            "huge": " ".join([*words[:-1], "1e30"]),
        }.get(damage, " ".join([damage, *words[1:]]))
    (tmp_path / "a.bvh").write_text("\n".join(lines))
    found, job = read(tmp_path / "a.bvh")
    # straight lines and constant turns are what is put in; the file holds eight digits
    np.testing.assert_allclose(world_places(found.clip), moves.places(), rtol=0, atol=1e-6)
    assert any("2 lost frames" in text for text in job.warnings)


def test_what_only_looks_like_a_number_that_is_none_is_named(tmp_path):
    lines = bvh_text(spinning(9)).splitlines()
    lines[-2] = " ".join(["1.#", *lines[-2].split()[1:]])
    (tmp_path / "a.bvh").write_text("\n".join(lines))
    with pytest.raises(FormatError, match="'1.#' is not a number") as raised:
        parse_bvh(str(tmp_path / "a.bvh"))
    assert raised.value.where.endswith(f"line {len(lines) - 1}")


def test_a_clip_that_is_mostly_lost_is_refused(tmp_path):
    lines = bvh_text(spinning(9)).splitlines()
    lines[-6:] = [" ".join(["nan"] * len(line.split())) for line in lines[-6:]]
    (tmp_path / "a.bvh").write_text("\n".join(lines))
    with pytest.raises(FormatError, match="6 of 9 frames are lost"):
        parse_bvh(str(tmp_path / "a.bvh"))


def test_a_wrong_count_and_a_cut_frame_are_said(tmp_path):
    moves = random_moves(4)
    found, job = read(write_bvh(tmp_path / "a.bvh", moves, frames_line=7))
    assert len(found.clip.rotations) == 4
    assert any("promises 7 frames, the file holds 4" in text for text in job.warnings)
    text = bvh_text(moves)
    head, _, data = text.partition("0333333\n")
    numbers = data.split()
    broken = "\n".join(" ".join(numbers[k : k + 10]) for k in range(0, len(numbers) - 5, 10))
    (tmp_path / "b.bvh").write_text(f"{head}0333333\n{broken}\n")
    found, job = read(tmp_path / "b.bvh")
    assert len(found.clip.rotations) == 3
    np.testing.assert_allclose(world_places(found.clip), moves.places()[:3], rtol=0, atol=1e-6)  # digits of the file
    assert any("it is left out" in text for text in job.warnings)


@pytest.mark.parametrize(
    ("change", "problem", "line"),
    [
        (("OFFSET", "OFSET"), "'OFSET' is not a word of BVH", 4),
        (("ROOT Hips", "ROOT Hips {}\nROOT Other"), "a second ROOT", 3),
        (("Xposition Yposition", "Xposition Xposition"), "at most once", 5),
        (("Xposition", "Wposition"), "channels wposition", 5),
        (("Frame Time: 0.0333333", ""), "no line 'Frame Time:'", None),
        (("Frame Time: 0.0333333", "Frame Time: 0"), "the frame time is 0 s", None),
        (("MOTION", ""), "is not a word of BVH", None),
        (("HIERARCHY", "}"), "closing brace", 1),
    ],
)
def test_what_breaks_the_format_is_named_with_its_line(tmp_path, change, problem, line):
    text = bvh_text(random_moves(2)).replace(*change, 1)
    (tmp_path / "a.bvh").write_text(text)
    with pytest.raises(FormatError, match=problem) as raised:
        parse_bvh(str(tmp_path / "a.bvh"))
    assert line is None or raised.value.where.endswith(f"line {line}")


CONVENTIONS = {
    "motionbuilder": lambda name: f"mixamorig:{name}",
    "cmu": lambda name: {
        **{f"{side}{a}": f"{side}{b}" for side in ("Left", "Right") for a, b in (
            ("Shoulder", "Collar"), ("Arm", "Shoulder"), ("ForeArm", "Elbow"), ("Hand", "Wrist"),
            ("UpLeg", "Hip"), ("Leg", "Knee"), ("Foot", "Ankle"), ("ToeBase", "Toe"))},
        "Spine1": "Chest",
    }.get(name, name),
    "smpl": lambda name: _sided(
        name, "{0}_{1}", ("Collar", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle", "Foot")
    ),
    "biped": lambda name: "Bip01 " + _sided(
        name, "{0} {1}", ("Clavicle", "UpperArm", "Forearm", "Hand", "Thigh", "Calf", "Foot", "Toe0")
    ),
    "makehuman": lambda name: {"Neck": "neck01", "Head": "head"}.get(name) or _sided(
        name, "{1}.{0}",
        ("clavicle", "upperarm01", "lowerarm01", "wrist", "upperleg01", "lowerleg01", "foot", "toe3-1"),
    ),
    "form": lambda name: f"j{NAMES.index(name)}",
}  # fmt: skip
ROLES = ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase")
OURS = ("clavicle", "shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe")


def _sided(name: str, pattern: str, words: tuple[str, ...]) -> str:
    for side in ("Left", "Right"):
        if name.startswith(side):
            return pattern.format(side[0], words[ROLES.index(name.removeprefix(side))])
    return name


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_joints_are_found_by_name_or_by_form(tmp_path, convention):
    names = [CONVENTIONS[convention](name) for name in NAMES]
    found, _ = read(write_bvh(tmp_path / "a.bvh", random_moves(), names=names))
    assert found.joints.convention == convention
    truth = {
        f"{side.lower()}_{ours}": names[NAMES.index(f"{side}{theirs}")]
        for side in ("Left", "Right")
        for ours, theirs in zip(OURS, ROLES, strict=True)
        if convention != "form" or ours not in ("clavicle", "toe")
    }
    mapped = {ours: found.clip.joint_names[k] for ours, k in found.joints.indices.items()}
    assert mapped.items() >= {**truth, "pelvis": names[0], "chest": names[2], "head": names[4]}.items()


def test_what_is_no_person_is_refused(tmp_path):
    text = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n"
    text += "End Site\n{\nOFFSET 0 1 0\n}\n}\n"
    (tmp_path / "a.bvh").write_text(text + "MOTION\nFrames: 1\nFrame Time: 0.1\n0 0 0\n")
    with pytest.raises(FormatError, match="not the skeleton of a person"):
        read(tmp_path / "a.bvh")


def test_an_unknown_unit_is_scaled_and_a_given_one_is_kept(tmp_path):
    path = write_bvh(tmp_path / "a.bvh", random_moves(), metres=0.3)
    found, job = read(path)
    assert found.axes.unit == "unknown"
    assert any("scaled to ordinary ones" in text for text in job.warnings)
    found, _ = read(path, unit="ft")
    np.testing.assert_allclose(world_places(found.clip), random_moves().places() * 0.3048 / 0.3, rtol=0, atol=1e-6)


def test_unknown_options_and_files_are_refused(tmp_path):
    path = write_bvh(tmp_path / "a.bvh", random_moves())
    for options in ({"unit": "ell"}, {"up": "Y"}):
        with pytest.raises(InputError, match="expected one of"):
            read_motion(path, **options)
    with pytest.raises(InputError, match="no such file"):
        read_motion(tmp_path / "b.bvh")


@pytest.mark.real_data
@pytest.mark.skipif(not REAL.exists(), reason="real motion is absent")
@pytest.mark.parametrize(
    ("name", "unit", "up", "frames", "convention"),
    [
        ("makehuman_tpose.bvh", "dm", "+Z", 1, "makehuman"),
        ("makehuman_walk1.bvh", "dm", "+Z", 14, "makehuman_old"),
        ("cmu_131_bvh/131_01.bvh", "CMU's", "+Y", 994, "cmu"),
        ("pymo_bvh/AV_8Walk_Meredith_HVHA_Rep1.bvh", "in", "+Y", 1064, "motionbuilder"),
    ],
)
def test_real_files_of_three_sources(name, unit, up, frames, convention):
    found = read_motion(REAL / name)
    assert (found.axes.unit, found.axes.up, found.joints.convention) == (unit, up, convention)
    assert len(found.clip.rotations) == frames
    mapped = {found.clip.joint_names[found.joints.indices[f"left_{joint}"]] for joint in ("hip", "wrist")}
    assert not any(one.startswith("__") for one in mapped)
    _, places = world_transforms(found.clip.parents, quaternion_matrices(found.clip.rotations), found.clip.translations)
    head = places[:, found.joints.indices["head"], 1] - places[..., 1].min(axis=1)
    assert 1.2 < np.median(head) < 1.8
