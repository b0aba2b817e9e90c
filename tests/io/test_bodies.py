"""What is known of a body: measurements by name and unit, silhouettes, landmarks, the avatar's archive."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import read_arrays, write_arrays
from vto_pipeline.io.bodies.avatars import read_avatar, receive_avatar, write_avatar
from vto_pipeline.io.bodies.measurements import (
    read_landmarks,
    read_measurements,
    read_silhouettes,
    write_landmarks,
    write_measurements,
)
from vto_pipeline.model.body import Avatar, Measurements

CUSTOMER = """\
sex: male
unit: cm
measurements:
  stature: 178
  chest_girth: 96.5
  waist_girth: 82
  mass: 75
sigmas: {waist_girth: 1.0}
"""


def test_lengths_become_metres_and_mass_stays(tmp_path: Path) -> None:
    (tmp_path / "customer.yaml").write_text(CUSTOMER)
    body = read_measurements(tmp_path / "customer.yaml")
    assert body.sex == "male"
    assert dict(body.values) == pytest.approx(
        {"stature": 1.78, "chest_girth": 0.965, "waist_girth": 0.82, "mass": 75.0}
    )
    assert dict(body.sigmas) == pytest.approx({"waist_girth": 0.01})


def test_measurements_come_back_exactly(tmp_path: Path) -> None:
    body = Measurements({"stature": 1.7, "hip_girth": 1 / 3}, {"hip_girth": 0.004}, "female", ("under clothing",))
    write_measurements(tmp_path / "measurements.json", body)
    assert read_measurements(tmp_path / "measurements.json") == body


@pytest.mark.parametrize(
    ("old", "new", "problem", "line", "hint"),
    [
        ("chest_girth", "chest_grith", "measurements.chest_grith: unknown measurement (got 96.5)", 5, "chest_girth?"),
        (
            "cm",
            "m",
            "measurements.stature: 178 m is not plausible; expected 0.5 to 2.6 m",
            4,
            "read in m; to change that, set unit:",
        ),
        ("178", "17.8", "measurements.stature: 0.178 m is not plausible; expected 0.5 to 2.6 m", 4, "read in cm"),
        ("cm", "inch", "unit: input should be 'm', 'cm', 'mm' or 'in' (got 'inch')", 2, ""),
        ("male", "boy", "sex: input should be 'female', 'male' or 'neutral' (got 'boy')", 1, ""),
        ("178", "-178", "measurements.stature: -1.78 m", 4, ""),
        ("178", ".nan", "measurements.stature: input should be a finite number (got nan)", 4, ""),
        ("75", "7500", "measurements.mass: 7500 kg is not plausible; expected 10.0 to 400.0 kg", 7, ""),
        ("sigmas", "sigma", "sigma: unknown key", 8, "did you mean sigmas?"),
        ("{waist_girth", "{waist", "sigmas.waist: unknown measurement", 8, "waist_girth?"),
        ("stature", "height", "measurements.height: unknown measurement (got 178.0)", 4, "did you mean stature?"),
        ("mass", "Weight", "measurements.Weight: unknown measurement (got 75.0)", 7, "did you mean mass?"),
        (
            "sigmas:",
            "waist girth: 80\n#",
            "outside the section measurements (got 80)",
            8,
            "measurements: {waist girth: 80}",
        ),
    ],
)
def test_a_wrong_protocol_is_named_with_its_line(
    tmp_path: Path, old: str, new: str, problem: str, line: int, hint: str
) -> None:
    text = CUSTOMER.replace(old, new, 1)
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(InputError) as caught:
        read_measurements(tmp_path / "a.yaml")
    assert problem in caught.value.problem
    assert caught.value.where.endswith(f"line {line}")
    assert hint in caught.value.hint
    assert caught.value.exit_code == 3


def write_views(folder: Path, orientation: int = 1) -> None:
    image = Image.new("RGB", (40, 80))
    tags = image.getexif()
    tags[274] = orientation
    image.save(folder / "front.png")
    image.save(folder / "side.jpg", exif=tags)


def test_silhouettes_of_a_folder_and_of_a_mapping(tmp_path: Path) -> None:
    write_views(tmp_path)
    (tmp_path / "stature.yaml").write_text("stature: 172\nunit: cm\n")
    found = read_silhouettes(tmp_path)
    assert (found.front.name, found.side.name) == ("front.png", "side.jpg")
    assert_allclose(found.stature, 1.72, rtol=1e-15)
    given = read_silhouettes({"front": tmp_path / "front.png", "side": tmp_path / "side.jpg", "stature": 1.72})
    assert given == found


def test_silhouettes_that_lie_on_their_side_are_refused(tmp_path: Path) -> None:
    write_views(tmp_path, orientation=6)
    (tmp_path / "stature.yaml").write_text("stature: 1.72\n")
    with pytest.raises(InputError, match="orientation 6") as caught:
        read_silhouettes(tmp_path)
    assert caught.value.where.endswith("side.jpg")


def test_incomplete_silhouettes_are_named(tmp_path: Path) -> None:
    write_views(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        read_silhouettes(tmp_path)
    (tmp_path / "stature.yaml").write_text("stature: 172\n")
    with pytest.raises(InputError, match="stature is 172.0 m") as caught:
        read_silhouettes(tmp_path)
    assert caught.value.hint == "is it in centimetres?"
    (tmp_path / "side.jpg").unlink()
    with pytest.raises(InputError, match="0 pictures named side"):
        read_silhouettes(tmp_path)
    with pytest.raises(InputError, match="silhouettes hold front; expected front, side, stature"):
        read_silhouettes({"front": tmp_path / "front.png"})


def test_landmarks_come_back_exactly(tmp_path: Path) -> None:
    points = {"back_neck": np.array([0.1, 1 / 3, -0.0]), "crotch": np.array([0.0, 0.8, 0.0])}
    write_landmarks(tmp_path / "landmarks.json", points)
    back = read_landmarks(tmp_path / "landmarks.json")
    assert set(back) == set(points)
    for name, point in points.items():
        assert back[name].tobytes() == point.tobytes()
    (tmp_path / "landmarks.json").write_text('{"back_neck": [1, 2]}')
    with pytest.raises(FormatError, match="not a table of points"):
        read_landmarks(tmp_path / "landmarks.json")


def avatar() -> Avatar:
    rng = np.random.default_rng(8)
    weights = rng.random((6, 2))
    return Avatar(
        bind_vertices=rng.normal(size=(6, 3)),
        faces=np.array([[0, 1, 2], [3, 4, 5]], np.int32),
        joint_names=("root", "head"),
        joints=rng.normal(size=(2, 3)),
        parents=np.array([-1, 0], np.int32),
        weights=weights / weights.sum(axis=1, keepdims=True),
        pose=rng.normal(size=(2, 3)),
        translation=rng.normal(size=3),
        vertices=rng.normal(size=(6, 3)),
        sex=0.25,
        landmarks={"crown": 5, "back_neck": 2},
        loops={"waist": np.array([0, 1, 2], np.int32), "wrist": np.array([3, 4, 5, 0], np.int32)},
        parameters={"stature": 1.7},
        sigmas={"waist_girth": 0.004},
        caveats=("estimated under clothing", "left arm not seen"),
    )


@pytest.mark.parametrize("read", [read_avatar, receive_avatar])
def test_the_avatar_comes_back_to_the_bit(tmp_path: Path, read: Callable[[Path], Avatar]) -> None:
    truth = avatar()
    write_avatar(tmp_path / "avatar.npz", truth)
    back = read(tmp_path / "avatar.npz")
    for name in ("bind_vertices", "faces", "joints", "parents", "weights", "pose", "translation", "vertices"):
        assert getattr(back, name).tobytes() == getattr(truth, name).tobytes()
    assert (back.joint_names, back.sex) == (truth.joint_names, truth.sex)
    for name in ("landmarks", "parameters", "sigmas"):
        assert dict(getattr(back, name)) == dict(getattr(truth, name))
    assert back.caveats == truth.caveats
    assert list(back.loops) == list(truth.loops)
    for name, loop in truth.loops.items():
        assert_array_equal(back.loops[name], loop)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"faces": np.array([[0, 1, 6]], np.int32)}, "an index is outside 0..5"),
        ({"landmark_vertices": np.array([5, -2], np.int32)}, "an index is outside 0..5"),
        ({"joints": np.zeros((3, 3))}, "shape (3, 3)"),
        ({"weights": np.full((6, 2), np.nan)}, "not finite"),
        ({"loop_lengths": np.array([3], np.int32)}, "not an avatar"),
        ({"vertices": None}, "not an avatar: KeyError('vertices')"),
    ],
)
def test_a_damaged_avatar_is_refused(tmp_path: Path, change: dict[str, np.ndarray | None], problem: str) -> None:
    write_avatar(tmp_path / "avatar.npz", avatar())
    arrays = read_arrays(tmp_path / "avatar.npz") | change
    write_arrays(tmp_path / "avatar.npz", {name: value for name, value in arrays.items() if value is not None})
    with pytest.raises(InputError) as caught:
        read_avatar(tmp_path / "avatar.npz")
    assert problem in caught.value.problem


@pytest.mark.parametrize(
    ("sex", "size", "chest_m"),
    [
        ("male", "M", 0.98),
        ("female", "m", 0.94),
        ("female", "4XL", 1.49),
        ("male", "XXXL", 1.35),
        ("female", "XS", 0.78),
    ],
)
def test_letter_of_en_13402_is_the_middle_of_its_chest(sex: str, size: str, chest_m: float) -> None:
    body = read_measurements({"sex": sex, "size": size, "measurements": {"stature": 170}})
    assert body.values == {"stature": 1.70, "chest_girth": pytest.approx(chest_m, abs=1e-12)}


def test_letter_beside_a_chest() -> None:
    given = {"sex": "male", "size": "M", "unit": "in", "measurements": {"Chest girth": 38.0}}
    assert read_measurements(given).values == {"chest_girth": pytest.approx(38 * 0.0254, abs=1e-12)}
    with pytest.raises(InputError, match=r"size M is a chest of 0.94 to 1.02 m, but a chest of 1.118 m is given"):
        read_measurements(given | {"measurements": {"Chest girth": 44.0}})


@pytest.mark.parametrize(
    ("document", "says"),
    [
        ({"size": "M"}, "letters differ between women and men"),
        ({"sex": "male", "size": "huge"}, "size 'huge' is not known; expected XXS"),
        ({"sex": "male"}, "neither measurements nor size"),
    ],
)
def test_letters_that_say_nothing(document: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_measurements(document)


def test_titles_of_iso_8559() -> None:
    written = {"Back neck point to waist": 41.0, "Upper-arm girth": 28.0, "Across front width": 33.0}
    assert set(read_measurements({"measurements": written}).values) == {
        "back_neck_to_waist",
        "upper_arm_girth",
        "across_front_width",
    }
