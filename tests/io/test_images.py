"""Pictures: exact pixels, bombs refused from the header, cut files named, EXIF to focal lengths."""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from vto_pipeline.errors import ConfigError, FormatError, InputError
from vto_pipeline.io.captures.exif import focal_length_px
from vto_pipeline.io.captures.images import check_images, read_gray16, read_image, read_image_size
from vto_pipeline.io.captures.photos import read_photos

RNG = np.random.default_rng(4)
PIXELS = RNG.integers(0, 256, (40, 60, 3)).astype(np.uint8)


def write_bomb(path: Path, side: int) -> None:
    """A PNG of a few hundred bytes that claims to be side x side pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    body = zlib.compress(bytes(100_000))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b""))


def write_photo(path: Path, exif: dict[int, object] | None = None, orientation: int = 1) -> None:
    image = Image.fromarray(PIXELS)
    tags = image.getexif()
    tags[274] = orientation
    for tag, value in (exif or {}).items():
        tags.get_ifd(34665)[tag] = value
    image.save(path, exif=tags)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_pixels_are_exact(tmp_path: Path, suffix: str) -> None:
    Image.fromarray(PIXELS).save(tmp_path / f"a{suffix}")
    assert_array_equal(read_image(tmp_path / f"a{suffix}"), PIXELS)
    assert read_image_size(tmp_path / f"a{suffix}") == (60, 40)


def test_grey_and_transparent_pictures_become_rgb(tmp_path: Path) -> None:
    Image.fromarray(PIXELS[..., 0]).save(tmp_path / "grey.png")
    assert_array_equal(read_image(tmp_path / "grey.png"), np.repeat(PIXELS[..., :1], 3, axis=2))
    Image.fromarray(np.dstack([PIXELS, PIXELS[..., 0]])).save(tmp_path / "rgba.png")
    assert_array_equal(read_image(tmp_path / "rgba.png"), PIXELS)


def test_sixteen_bits_are_exact_and_eight_are_refused(tmp_path: Path) -> None:
    values = RNG.integers(0, 65536, (40, 60)).astype(np.uint16)
    Image.fromarray(values).save(tmp_path / "depth.png")
    assert_array_equal(read_gray16(tmp_path / "depth.png"), values)
    Image.fromarray(PIXELS).save(tmp_path / "eight.png")
    with pytest.raises(FormatError, match="pixel mode RGB; expected one 16-bit channel"):
        read_gray16(tmp_path / "eight.png")


@pytest.mark.parametrize("read", [read_image, read_image_size, lambda path: check_images([path])])
def test_a_bomb_is_refused_from_its_header(tmp_path: Path, read: Callable[[Path], object]) -> None:
    write_bomb(tmp_path / "bomb.png", 20_000)
    used = sum(os.times()[:4])  # of this process and its children, whatever else runs
    with pytest.raises(FormatError, match="pixels; the limit is 80 million") as caught:
        read(tmp_path / "bomb.png")
    assert caught.value.hint == "scale it down"
    assert sum(os.times()[:4]) - used < 5.0  # s: nothing was unpacked
    write_bomb(tmp_path / "smaller.png", 9_500)  # below Pillow's own limits
    with pytest.raises(FormatError, match="claims 9500 x 9500 pixels"):
        read(tmp_path / "smaller.png")


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_cut_picture_is_refused(tmp_path: Path, suffix: str, share: float) -> None:
    path = tmp_path / f"a{suffix}"
    Image.fromarray(PIXELS).save(path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(FormatError, match="damaged or truncated|not a readable picture"):
        read_image(path)


def test_another_format_under_an_allowed_name_is_refused(tmp_path: Path) -> None:
    Image.fromarray(PIXELS).save(tmp_path / "a.bmp")
    (tmp_path / "a.bmp").rename(tmp_path / "a.png")
    with pytest.raises(FormatError, match="not a readable picture"):
        read_image(tmp_path / "a.png")
    (tmp_path / "a.png").rename(tmp_path / "a.bmp")
    with pytest.raises(InputError, match="files of type .bmp are not supported"):
        read_image(tmp_path / "a.bmp")


def test_photos_are_sorted_and_carry_focal_lengths_and_the_board(tmp_path: Path) -> None:
    write_photo(tmp_path / "b.jpg", {41989: 50})
    write_photo(tmp_path / "a.png")
    (tmp_path / ".hidden.jpg").write_bytes(b"")
    (tmp_path / "notes.txt").write_text("no photo")
    (tmp_path / "board.yaml").write_text("columns: 7\nrows: 5\nsquare_mm: 40\nmarker_mm: 30\n")
    photos = read_photos(tmp_path)
    assert [path.name for path in photos.paths] == ["a.png", "b.jpg"]
    assert photos.intrinsics[0] is None
    camera = photos.intrinsics[1]
    assert camera is not None
    assert_allclose(camera.fx, 50.0 * math.hypot(60, 40) / math.hypot(36, 24), rtol=1e-12)  # CIPA DC-008
    assert (camera.cx, camera.cy) == (29.5, 19.5)
    assert photos.board is not None
    assert (photos.board.square_m, photos.board.marker_m, photos.board.dictionary) == (0.04, 0.03, "DICT_4X4_250")


def test_orientation_is_read_and_pixels_stay_as_stored(tmp_path: Path) -> None:
    write_photo(tmp_path / "a.png", orientation=6)
    assert_array_equal(read_image(tmp_path / "a.png"), PIXELS)
    assert check_images([tmp_path / "a.png"])["orientations"].tolist() == [6]
    write_photo(tmp_path / "a.tif", orientation=6)
    with pytest.raises(FormatError, match="a TIFF that EXIF marks as rotated"):
        read_image(tmp_path / "a.tif")


@pytest.mark.parametrize("suffix", [".jpg", ".png"])  # Pillow writes no EXIF directory into a TIFF
def test_every_format_tells_its_focal_length(tmp_path: Path, suffix: str) -> None:
    write_photo(tmp_path / f"a{suffix}", {41989: 36})
    focal = check_images([tmp_path / f"a{suffix}"])["focal_px"]
    assert_allclose(focal, 60.0, rtol=1e-12)  # 36 mm of film is one width of a 3:2 picture


def test_one_broken_photo_is_named_before_any_work(tmp_path: Path) -> None:
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        write_photo(tmp_path / name)
    (tmp_path / "b.jpg").write_bytes((tmp_path / "b.jpg").read_bytes()[:-600])
    with pytest.raises(FormatError, match="damaged or truncated") as caught:
        read_photos(tmp_path)
    assert caught.value.where.endswith("b.jpg")


def test_one_changed_byte_of_a_png_is_found(tmp_path: Path) -> None:
    """Its pixels would still be decoded, to others; a PNG has checksums, which zlib computes, too."""
    write_photo(tmp_path / "a.png")
    data = bytearray((tmp_path / "a.png").read_bytes())
    check_images([tmp_path / "a.png"])
    at = data.index(b"IDAT") + 4
    length = int.from_bytes(data[at - 8 : at - 4], "big")
    data[at + length // 2] ^= 1
    assert zlib.crc32(data[at - 4 : at + length]) != int.from_bytes(data[at + length : at + length + 4], "big")
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(FormatError, match="damaged") as caught:
        check_images([tmp_path / "a.png"])
    assert caught.value.where.endswith("a.png")


def test_a_folder_without_photos_and_a_bad_board_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="0 photo\\(s\\)"):
        read_photos(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        read_photos(tmp_path / "nowhere")
    for name in ("a.jpg", "b.jpg"):
        write_photo(tmp_path / name)
    (tmp_path / "board.yaml").write_text("columns: 7\nrows: 5\nsquare_cm: 4\nmarker_mm: 30\n")
    with pytest.raises(ConfigError, match="square_mm: field required|square_cm: unknown key"):
        read_photos(tmp_path)


def test_focal_length_follows_the_sensor_before_the_film() -> None:
    """55 mm on a 4272 px wide sensor at 4720.44 px/inch, resized to 1200 px: a Canon EOS 1100D."""
    exif = {37386: 55.0, 41486: 4720.441988950276, 41488: 2, 40962: 4272, 41989: 90}
    expected = 55.0 / 25.4 * 4720.441988950276 * 1200 / 4272
    assert_allclose(focal_length_px(exif, 1200, 800), expected, rtol=1e-12)  # the same arithmetic
    assert_allclose(focal_length_px({41989: 36}, 3600, 2400), 3600, rtol=1e-12)  # 36 mm of film is one width
    assert_allclose(focal_length_px({41989: 36}, 2400, 3600), 3600, rtol=1e-12)  # held upright


@pytest.mark.parametrize(
    "exif", [{}, {37386: 50.0}, {37386: 50.0, 41486: 1.0}, {41989: 0}, {41989: "no"}, {37386: math.nan, 41486: 100.0}]
)
def test_useless_exif_gives_no_focal_length(exif: dict[int, object]) -> None:
    assert math.isnan(focal_length_px(exif, 1200, 800))
