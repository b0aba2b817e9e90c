"""A picture of each of many drapes: garments down, bodies across, each marked with how it ended."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from PIL import Image, ImageDraw

from vto_pipeline.bench.bench import Value
from vto_pipeline.errors import VtoError
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render.frames import frame_view
from vto_pipeline.render.pictures import render_picture
from vto_pipeline.render.tint import CLOTH, SKIN, tint

_WIDE, _TALL, _LINE = 150, 220, 15  # px: of a cell, and of a line of text
_MARKS = {"at rest": (0, 140, 60), "not at rest": (220, 150, 0), "too small": (130, 130, 130)}
_FAILED = (200, 30, 30)


def write_picture_table(
    path: Path,
    rows: Sequence[Mapping[str, Value]],
    bodies: Mapping[str, Path],
    folder: Callable[[Mapping[str, Value]], Path],
) -> None:
    """Write a PNG with a picture of each row's drape on one of these bodies, or as far as it got.

    Args:
        path: Of the PNG.
        rows: Of these bodies and others: "garment", "body", "fabric", "outcome", "settled", "too_small" and "seconds".
        bodies: Mesh files by name.
        folder: Returns where a row's run is.
    """
    rows = [row for row in rows if row["body"] in bodies]
    across = list(dict.fromkeys((str(row["body"]), str(row["fabric"])) for row in rows))
    down = list(dict.fromkeys(str(row["garment"]) for row in rows))
    tall = _TALL + 2 * _LINE
    picture = Image.new("RGB", (_WIDE * len(across), tall * len(down)), "white")
    ink = ImageDraw.Draw(picture)
    shown = {name: tint(read_mesh(file), SKIN) for name, file in bodies.items()}
    for row in rows:
        left = _WIDE * across.index((str(row["body"]), str(row["fabric"])))
        top = tall * down.index(str(row["garment"]))
        body, cloth = shown[str(row["body"])], _draped(folder(row) / "out")
        meshes = [body] if cloth is None else [body, tint(cloth, CLOTH)]
        cell = render_picture(meshes, frame_view("front", [body]), size=(_WIDE, _TALL))
        picture.paste(Image.fromarray(cell), (left, top))
        word = _how_it_ended(row)
        ink.text((left + 4, top + _TALL), f"{row['garment']}"[:24], fill="black")
        ink.text((left + 4, top + _TALL + _LINE - 3), f"{word}, {row['seconds']:.0f} s", fill=_MARKS.get(word, _FAILED))
    picture.save(path, optimize=True)


def _how_it_ended(row: Mapping[str, Value]) -> str:
    """Return in a word or three what became of a drape."""
    if row["outcome"] == "done":
        return "at rest" if row["settled"] else "not at rest"
    return "too small" if row["too_small"] else str(row["outcome"])


def _draped(out: Path) -> TriangleMesh | None:
    """Return the cloth as it is draped, or as far as it got; None where it was not begun."""
    for file in (out / "draped.ply", out / "partial" / "draped.ply"):
        if file.exists():
            try:
                return read_mesh(file)
            except VtoError:
                return None
    return None
