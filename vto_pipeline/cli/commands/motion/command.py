"""vto motion"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from vto_pipeline.cli.options import PATH, Quantity, message_options
from vto_pipeline.cli.session import Session, pass_session
from vto_pipeline.errors import ConfigError
from vto_pipeline.units import LENGTH_M, TIME_S

_UP = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")


@contextmanager
def _file_of(source: str) -> Iterator[str]:
    """The file, or what standard input holds, in one."""
    if source != "-":
        yield source
        return
    with TemporaryDirectory() as folder:
        path = Path(folder) / "standard_input.jsonl"
        with path.open("wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        yield str(path)


@click.command("motion")
@click.argument("source", metavar="FILE", type=str)
@click.option("--avatar", type=PATH, metavar="FILE", help="avatar.npz of `vto fit`. [default: the mean body]")
@click.option("-o", "--output", type=PATH, metavar="FOLDER", help="Write motion.npz and motion.glb there.")
@click.option("--fps", type=click.FloatRange(1, 240), help="Frames per second. [default: the file's]")
@click.option("--lead-in", type=Quantity(TIME_S), metavar="0.5s", help="Begin in the avatar's own pose.")
@click.option(
    "--hips-aside", type=Quantity(LENGTH_M), metavar="60mm", help="How far hips may move aside to keep the balance."
)
@click.option("--unit", type=click.Choice(sorted(LENGTH_M)), help="Unit of length. [default: found from the legs]")
@click.option("--up", type=click.Choice(_UP), help="Axis that points up. [default: found from the body]")
@message_options
@pass_session
def motion_command(
    session: Session,
    source: str,
    avatar: Path | None,
    output: Path | None,
    fps: float | None,
    lead_in: float | None,
    hips_aside: float | None,
    unit: str | None,
    up: str | None,
) -> None:
    """Show what a motion holds, and carry it over to an avatar.

    Reads BVH, glTF and GLB with a skeleton, poses of the SMPL family (.npz), and poses in YAML. Also joints that a
    camera follows, as JSON lines: from a file (.jsonl), or from standard input where FILE is a dash. Presets have
    names: t_pose, a_pose, arms_down, arms_up, sitting, walking_step.

    \b
    vto motion walk.bvh
    vto motion walk.bvh --avatar runs/customer/out/avatar.npz -o walk/
    vto motion sitting --avatar avatar.npz -o sitting/
    depth_camera | vto motion - --avatar avatar.npz -o live/
    """
    from vto_pipeline.avatar.motion.figures import crossing_frames
    from vto_pipeline.avatar.motion.retarget import RetargetConfig, retarget
    from vto_pipeline.avatar.template.template import template
    from vto_pipeline.cli.commands.motion.lines import FRAMES_LOOKED_AT, motion_facts, motion_lines
    from vto_pipeline.cloth.model.settings import checked
    from vto_pipeline.geometry.topology import vertex_normals
    from vto_pipeline.io.bodies.avatars import receive_avatar
    from vto_pipeline.io.gltf.animate import animated_glb, write_glb_bytes
    from vto_pipeline.io.motion.archive import write_avatar_motion
    from vto_pipeline.io.motion.read import read_motion
    from vto_pipeline.model.job import Job
    from vto_pipeline.model.mesh import TriangleMesh

    if output is not None and output.exists() and not output.is_dir():
        raise ConfigError("expected a folder, found a file", where=str(output))
    job = Job()
    with _file_of(source) as file:
        read = read_motion(file, unit=unit, up=up, job=job)
    body = template() if avatar is None else receive_avatar(avatar)
    session.say(f"carrying over {len(read.clip.rotations)} frames")
    aside = 1e3 * (hips_aside or 0.0)
    wanted = {"frames_per_second": fps or 0.0, "lead_in_s": lead_in or 0.0, "hips_aside_mm": aside}
    config = checked(RetargetConfig, wanted)
    motion, figures = retarget(read.clip, read.joints, body, config, job)
    crossing = crossing_frames(motion, body, FRAMES_LOOKED_AT)
    if crossing[0]:
        job.warn(f"an arm or a leg passes through the body in {crossing[0]} of {crossing[1]} frames looked at")
    facts = motion_facts(read, motion, figures, crossing)
    written = []
    if output is not None:
        written = [output / "motion.npz", output / "motion.glb"]
        write_avatar_motion(written[0], motion)
        normals = vertex_normals(TriangleMesh(body.bind_vertices, body.faces))
        write_glb_bytes(written[1], animated_glb(body, normals, motion)[0])
    data = {"path": source, **facts, "notes": job.notes, "warnings": job.warnings, "written": list(map(str, written))}
    said = [*job.notes, *(f"warning: {text}" for text in job.warnings), *(f"written: {path}" for path in written)]
    session.answer(data, [*motion_lines(facts), "", *said])
