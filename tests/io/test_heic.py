"""HEIC photos. `ramp.heic` was made by libheif's `heif-enc -q 90` from the picture of `ramp`, 26 mm in 35 mm film."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from vto_pipeline.errors import FormatError, MissingDependencyError
from vto_pipeline.io.captures import heic
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.captures.photos import read_photos
from vto_pipeline.io.sniff import find_kind

SAMPLE = Path(__file__).with_name("ramp.heic")


def ramp() -> np.ndarray:
    y, x = np.mgrid[0:48, 0:64]
    return np.stack([4 * x, 5 * y, 255 - 2 * x - 2 * y], axis=-1).clip(0, 255)


def test_photos_of_a_phone_are_read_with_their_lens(tmp_path: Path) -> None:
    shutil.copy(SAMPLE, tmp_path / "IMG_1.HEIC")
    Image.fromarray(ramp().astype(np.uint8)).save(tmp_path / "IMG_2.png")
    assert find_kind(tmp_path) == ("photos", "it holds 2 pictures")
    photos = read_photos(tmp_path)
    assert [path.name for path in photos.paths] == ["IMG_1.HEIC.jpg", "IMG_2.png"]
    assert len({path.parent for path in photos.paths}) == 1  # COLMAP wants them in one folder
    assert np.abs(read_image(photos.paths[0]) - ramp()).mean() < 3.0  # of 255: two lossy codecs
    assert np.abs(read_image(photos.paths[1]) - ramp()).max() == 0
    lens = photos.intrinsics[0]
    assert lens is not None
    assert lens.fx == pytest.approx(26.0 * np.hypot(64, 48) / np.hypot(36, 24))  # CIPA DC-008: by the diagonal


def test_a_damaged_one_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.heic").write_bytes(SAMPLE.read_bytes()[:300])
    shutil.copy(SAMPLE, tmp_path / "b.heic")
    with pytest.raises(FormatError, match="not a readable HEIC picture"):
        read_photos(tmp_path)


def test_without_the_library_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heic, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match="pi-heif"):
        heic.copy_as_jpeg([SAMPLE], tmp_path)
