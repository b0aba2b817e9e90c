"""The nine bodies of the docs: three sizes of a woman, a man and a blend, from the front, the side and the back.

Run as `python -m vto_pipeline.bench.body_gallery docs/bodies.png`.
"""

from __future__ import annotations

import sys

import numpy as np
from PIL import Image

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.io.bodies.size_letters import chest_range
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.body import Measurements
from vto_pipeline.render.frames import BACK, FRONT, LEFT, frame_box
from vto_pipeline.render.pictures import render_picture

_LETTERS = ("XS", "M", "4XL")
_STATURE_M = {"female": 1.66, "neutral": 1.72, "male": 1.78}
_TALL_M, _TALL_PX = 1.80, 440


def draw_bodies() -> ByteArray:
    """One row per size, all at one scale, shape (H, W, 3), sRGB."""
    rows = []
    for letter in _LETTERS:
        views = []
        for sex, stature in _STATURE_M.items():
            body = fit_measurements(
                Measurements({"stature": stature, "chest_girth": _chest(letter, sex)}, sex=sex)
            ).mesh
            for side, width in ((FRONT, 370), (LEFT, 170), (BACK, 370)):
                size = (width, _TALL_PX)
                views.append(render_picture([body], frame_box(*_framed(width), side, 0.0), size=size, margin=0.01))
        rows.append(np.hstack(views))
    return np.vstack(rows)


def _chest(letter: str, sex: str) -> float:
    both = [sum(chest_range(letter, one)) / 2 for one in ("female", "male")]
    return {"female": both[0], "male": both[1], "neutral": sum(both) / 2}[sex]


def _framed(width: int) -> tuple[FloatArray, FloatArray]:
    """The same height for every view, so that all are at one scale."""
    reach = 0.5 * _TALL_M * width / _TALL_PX
    return np.array([-reach, 0.0, -reach]), np.array([reach, _TALL_M, reach])


if __name__ == "__main__":
    Image.fromarray(draw_bodies()).quantize(64).save(sys.argv[1], optimize=True)
