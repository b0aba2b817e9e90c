"""Pictures of views, and of a turn, into files."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vto_pipeline.cli.session import Session
from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.mesh import TriangleMesh

if TYPE_CHECKING:
    from vto_pipeline.render.frames import Frame

_FRAMES, _PER_SECOND = 72, 24.0
_ANIMATED_PX = 960  # height, at most
_ASIDE_DEG = 30.0  # towards the person's left: steps and arms are seen, and the front
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
    from vto_pipeline.stages.entry.shown import painted, shown_surfaces

    written_by_run = path.suffix.lower() == ".glb" and path.parent.name == "out" and is_run(path.parents[1])
    if written_by_run:  # its parts are known, and each has its colour
        return [painted(part) for part in read_glb(path)], path.parent / "pictures"
    if not (path.is_dir() and is_run(path)):
        return [read_mesh(path)], path.parent / "pictures"
    meshes = shown_surfaces(open_run(path))
    if not meshes:
        raise InputError("this run made nothing that can be drawn", where=str(path), hint="has it ended?")
    return meshes, path / "out" / "pictures"


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
    from vto_pipeline.render.frames import frame_turn

    began = time.perf_counter()
    scenes = ((meshes, frame) for frame in frame_turn(meshes, _FRAMES))
    write_animation(path, _told(session, "turntable", scenes, _FRAMES, size), _PER_SECOND)
    return {"file": str(path), "frames": _FRAMES, "seconds": round(time.perf_counter() - began, 3)}


def draw_motion(session: Session, run: Path, path: Path, size: int) -> dict[str, Any]:
    """Draw a run's garment in motion on its avatar, all of it in the picture; return its file and seconds.

    Raises:
        InputError: the run made no garment in motion.
    """
    from vto_pipeline.io.animations import write_animation
    from vto_pipeline.render.frames import frame_box
    from vto_pipeline.stages.entry.moving import moving_scene
    from vto_pipeline.stages.entry.outcome import open_run

    began = time.perf_counter()
    scene = moving_scene(open_run(run))
    frame = frame_box(*scene.bounds(), _ASIDE_DEG)
    pictures = _told(session, "motion", ((scene.at(k), frame) for k in range(len(scene))), len(scene), size)
    write_animation(path, pictures, scene.frames_per_second)
    return {"file": str(path), "frames": len(scene), "seconds": round(time.perf_counter() - began, 3)}


def _told(
    session: Session, what: str, scenes: Iterable[tuple[Sequence[TriangleMesh], Frame]], count: int, size: int
) -> Iterator[ByteArray]:
    """Draw one picture after another, and say from time to time how many are left."""
    from vto_pipeline.render.pictures import render_picture

    began = last = time.perf_counter()
    for done, (meshes, frame) in enumerate(scenes):
        now = time.perf_counter()
        if now - last > _SILENCE_S:
            last = now
            session.say(f"{what}: {done} of {count} frames, {(now - began) / done * (count - done):.0f} s left")
        yield render_picture(meshes, frame, size=_shape(min(size, _ANIMATED_PX)), shadows=True)


def _shape(height: int) -> tuple[int, int]:
    return round(0.75 * height), height
