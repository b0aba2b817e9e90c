"""Find the corners of a ChArUco board in photos."""

from __future__ import annotations

from typing import Any

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.frames import CharucoBoard, PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.numerics.srgb import decode_srgb
from vto_pipeline.scan.library_message import library_message

LONGER_SIDE = 2400
"""Smaller photos are enlarged to this [px]: a marker seen at a slant is then told from its neighbours."""


def board_corners(board: CharucoBoard) -> FloatArray:
    """Inner chess corners in the world that the board defines: floor y = 0, +X along the columns, centre at the origin.

    Seen from above with the first marker at the upper left, +X is right and +Z down, so +Y points at the camera.

    Returns:
        [m], shape ((columns - 1) (rows - 1), 3), in the order of OpenCV's corner ids.
    """
    z, x = np.meshgrid(np.arange(1, board.rows), np.arange(1, board.columns), indexing="ij")
    flat = np.stack([x - board.columns / 2, np.zeros_like(x, dtype=float), z - board.rows / 2], axis=-1)
    corners: FloatArray = flat.reshape(-1, 3) * board.square_m
    return corners


def detect_board(photos: PhotoSet, names: tuple[str, ...], job: Job) -> list[tuple[IntArray, FloatArray]]:
    """Detect the board's corners in the named photos.

    Looked for in light and in the levels that encode it; what shows more corners is kept. A lens blurs light: in
    levels, bright cells outgrow dark ones. One marker that is read tells where the others are (`tryRefineMarkers`), and
    beside one alone a corner counts: of a board far off or at a slant, few can be read.

    Args:
        photos: The photos and the board.
        names: Of the photos to look at.
        job: Notified of photos that the detector failed on.

    Returns:
        Per photo: corner ids (K,), and pixels (K, 2), of which there may be none.

    Raises:
        InputError: OpenCV knows no such dictionary of markers.
    """
    import cv2

    board = photos.board
    assert board is not None
    if not hasattr(cv2.aruco, board.dictionary):
        raise InputError(f"{board.dictionary} is not a dictionary of OpenCV", hint="for example DICT_4X4_250")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    pattern = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, dictionary)
    reading = cv2.aruco.CharucoParameters()
    reading.tryRefineMarkers, reading.minMarkers = True, 1
    detector = cv2.aruco.CharucoDetector(pattern, reading)
    light = (255.0 * decode_srgb(np.arange(256, dtype=np.uint8))).astype(np.float32)
    paths = {path.name: path for path in photos.paths}
    found = []
    for name in names:
        try:
            levels = cv2.cvtColor(read_image(paths[name]), cv2.COLOR_RGB2GRAY)
            shown = [_corners(detector, of) for of in (light[levels], levels)]
        except cv2.error as error:
            job.note(f"no board in {name}: {library_message(error)}")
            found.append((np.empty(0, np.int32), np.empty((0, 2))))
            continue
        found.append(max(shown, key=lambda one: len(one[0])))
    return found


def _corners(detector: Any, gray: Any) -> tuple[IntArray, FloatArray]:
    """Return ids (K,) and pixels (K, 2) of the corners that a grey picture shows."""
    import cv2

    scale = max(1.0, LONGER_SIDE / max(gray.shape))
    if scale > 1.0:
        gray = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    if gray.dtype != np.uint8:
        gray = np.rint(gray).clip(0, 255).astype(np.uint8)
    pixels, ids, _, _ = detector.detectBoard(gray)
    if ids is None or pixels is None:
        return np.empty(0, np.int32), np.empty((0, 2))
    places = np.asarray(pixels, float).reshape(-1, 2)
    return np.asarray(ids, np.int32).ravel(), (places + 0.5) / scale - 0.5
