"""Pictures of views, and of a turn, into files."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from vto_pipeline.cli.session import Session
from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.mesh import TriangleMesh

_FRAMES, _PER_SECOND = 72, 24.0
_TURN_PX = 960  # height, at most
_SILENCE_S = 5.0  # between two lines on what is done


def meshes_of(path: Path) -> tuple[list[TriangleMesh], Path]:
    """Return what is drawn of a run or a mesh file, what matters most first, and where its pictures belong.

    Raises:
        InputError: nothing that can be drawn; FormatError: a broken file.
    """
    from vto_pipeline.io.gltf.write import read_glb
    from vto_pipeline.io.meshes import read_mesh
    from vto_pipeline.pipeline.execution.folder import is_run
    from vto_pipeline.stages.entry.outcome import open_run
    from vto_pipeline.stages.entry.shown import painted, shown_artifacts, shown_meshes

    written_by_run = path.suffix.lower() == ".glb" and path.parent.name == "out" and is_run(path.parents[1])
    if written_by_run:  # its parts are known, and each has its colour
        return [painted(part) for part in read_glb(path)], path.parent / "pictures"
    if not (path.is_dir() and is_run(path)):
        return [read_mesh(path)], path.parent / "pictures"
    outcome = open_run(path)
    names = shown_artifacts(outcome, detailed=True)
    if not names:
        raise InputError("this run made nothing that can be drawn", where=str(path), hint="has it ended?")
    return [mesh for name in names for mesh in shown_meshes(name, outcome.read(name))], path / "out" / "pictures"


def draw_views(
    session: Session, meshes: Sequence[TriangleMesh], views: Sequence[str], size: int, folder: Path
) -> dict[str, Any]:
    """Draw named views; return each one's file and seconds."""
    from PIL import Image

    from vto_pipeline.io.files import replacing
    from vto_pipeline.render.frames import frame_view
    from vto_pipeline.render.pictures import render_picture

    made = {}
    for name in views:
        began = time.perf_counter()
        picture = render_picture(meshes, frame_view(name, meshes), size=_shape(size), shadows=True)
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{name}.png"
        with replacing(path) as beside:
            Image.fromarray(picture).save(beside, format="png")
        made[name] = {"file": str(path), "seconds": round(time.perf_counter() - began, 3)}
    return made


def draw_turn(session: Session, meshes: Sequence[TriangleMesh], path: Path, size: int) -> dict[str, Any]:
    """Draw a turn about the upright; return its file and seconds."""
    from vto_pipeline.io.animations import write_animation

    began = time.perf_counter()
    write_animation(path, _turn(session, meshes, min(size, _TURN_PX)), _PER_SECOND)
    return {"file": str(path), "frames": _FRAMES, "seconds": round(time.perf_counter() - began, 3)}


def _turn(session: Session, meshes: Sequence[TriangleMesh], size: int) -> Iterator[ByteArray]:
    from vto_pipeline.render.frames import frame_turn
    from vto_pipeline.render.pictures import render_picture

    began = last = time.perf_counter()
    for done, frame in enumerate(frame_turn(meshes, _FRAMES)):
        now = time.perf_counter()
        if now - last > _SILENCE_S:
            last = now
            session.say(f"turntable: {done} of {_FRAMES} frames, {(now - began) / done * (_FRAMES - done):.0f} s left")
        yield render_picture(meshes, frame, size=_shape(size), shadows=True)


def _shape(height: int) -> tuple[int, int]:
    return round(0.75 * height), height
