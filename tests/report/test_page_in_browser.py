"""The page in a real browser: no console message of its own, and the 3D view is drawn without being touched."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from report_parts import all_parts, run_record

from vto_pipeline.report.page import build_page

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update", "--hide-scrollbars"),
    *("--enable-logging=stderr", "--v=0"),
)
SOFTWARE_WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")


def photograph(folder: Path, parts: dict, *flags: str, at: str = "") -> tuple[np.ndarray, list[str]]:
    """The page as pixels, shape (1000, 1000, 3), and what the console said."""
    (folder / "page.html").write_text(build_page(run_record(), parts), encoding="utf-8")
    places = (f"--user-data-dir={folder / 'profile'}", f"--screenshot={folder / 'page.png'}", "--window-size=1000,1000")
    command = [str(BROWSER), *FLAGS, *flags, *places, (folder / "page.html").as_uri() + at]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line and "GL Driver Message" not in line]
    with Image.open(folder / "page.png") as image:
        return np.asarray(image.convert("RGB")).astype(int), said


def test_the_view_is_drawn_and_the_console_is_silent(tmp_path: Path) -> None:
    pixels, said = photograph(tmp_path, all_parts(), *SOFTWARE_WEBGL)
    assert said == []
    red = (pixels[..., 0] > 1.7 * pixels[..., 1]) & (
        pixels[..., 0] > 80
    )  # the shirt's red stripes, nothing else is red
    assert 5_000 < red.sum() < 200_000
    rows, columns = np.nonzero(red)
    assert abs(columns.mean() - 500) < 20  # framed in the middle
    assert np.ptp(rows) > 150


def test_without_webgl_the_page_says_so_and_goes_on(tmp_path: Path) -> None:
    pixels, said = photograph(tmp_path, all_parts(), "--disable-3d-apis")
    assert said == []
    assert pixels.std() > 5
    red = (pixels[..., 0] > 1.7 * pixels[..., 1]) & (pixels[..., 0] > 80)
    assert red.sum() == 0
