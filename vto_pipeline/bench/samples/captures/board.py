"""The ChArUco board at the foot of the form.

It lies on the floor, y = 0, its centre at the origin. OpenCV's board frame starts at the top left corner of the print,
x along the columns, y along the rows, z = x cross y. Here board x is world +X and board y is world +Z (the rows run
towards the front), so board z is world -Y, into the floor.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.bench.samples.captures.render import PICTURE, Surface
from vto_pipeline.io.files import replacing
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.frames import CharucoBoard
from vto_pipeline.model.mesh import TriangleMesh

BOARD = CharucoBoard(columns=9, rows=7, square_m=0.09, marker_m=0.069, dictionary="DICT_4X4_50")
PIXELS_PER_SQUARE = 180
CELLS = 40  # of the mesh along the longer side, for the light


def charuco(board: CharucoBoard) -> Any:
    """The same board for OpenCV."""
    import cv2

    markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    return cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, markers)


def world_from_board(board: CharucoBoard) -> FloatArray:
    """Rigid transform from OpenCV's board frame to the world, shape (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    matrix[:3, 3] = [-0.5 * board.columns * board.square_m, 0.0, -0.5 * board.rows * board.square_m]
    return matrix


def board_picture(board: CharucoBoard) -> tuple[ByteArray, float]:
    """The print, shape (H, W), and its pixels per metre."""
    size = (board.columns * PIXELS_PER_SQUARE, board.rows * PIXELS_PER_SQUARE)
    return charuco(board).generateImage(size), PIXELS_PER_SQUARE / board.square_m


def board_surface(board: CharucoBoard) -> Surface:
    """The board as a flat grid facing up."""
    width, depth = board.columns * board.square_m, board.rows * board.square_m
    x, y = np.meshgrid(np.linspace(0.0, width, CELLS + 1), np.linspace(0.0, depth, CELLS + 1))
    flat = np.stack([x.ravel(), y.ravel()], axis=1)
    placed = world_from_board(board)
    vertices = flat @ placed[:3, :2].T + placed[:3, 3]
    corner = (np.arange(CELLS)[:, None] * (CELLS + 1) + np.arange(CELLS)).ravel()
    right, down, across = corner + 1, corner + CELLS + 1, corner + CELLS + 2
    faces = np.concatenate([np.stack([corner, down, right], 1), np.stack([right, down, across], 1)])
    return Surface(TriangleMesh(vertices, faces), PICTURE, flat[faces])


def write_board(path: Path) -> None:
    """Write board.yaml."""
    text = f"""# Lies on the floor (y = 0), its centre at the origin; its columns run along +X, its rows along +Z.
columns: {BOARD.columns}
rows: {BOARD.rows}
square_mm: {1000 * BOARD.square_m:g}
marker_mm: {1000 * BOARD.marker_m:g}
dictionary: {BOARD.dictionary}
"""
    with replacing(path) as beside:
        beside.write_text(text, encoding="utf-8")
