"""The command `vto render`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, message_options, quiet_option
from vto_pipeline.cli.session import Session, pass_session

_LARGEST_PX = 4096


def _names(ctx: click.Context, param: click.Parameter, value: str) -> list[str]:
    from vto_pipeline.render.frames import VIEWS

    names = [name.strip() for name in value.split(",") if name.strip()]
    unknown = [name for name in names if name not in VIEWS]
    if unknown:
        raise click.BadParameter(f"no view {unknown[0]!r}; allowed: {', '.join(VIEWS)}", ctx, param)
    return list(dict.fromkeys(names))


@click.command("render")
@click.argument("path", metavar="RUN|FILE", type=PATH)
@click.option("--views", default="front,side,back,closeup", show_default=True, callback=_names, help="Which pictures.")
@click.option(
    "--size", type=click.IntRange(64, _LARGEST_PX), default=1600, show_default=True, help="Height of a picture [px]."
)
@click.option(
    "--turntable", type=PATH, metavar="FILE.mp4|gif", help="Also a turn of 72 frames, 24 a second; at most 960 px high."
)
@click.option("--motion", type=PATH, metavar="FILE.mp4|gif", help="Also the run's motion; at most 960 px high.")
@click.option(
    "--web", type=PATH, metavar="FILE.glb", help="Also a GLB for web pages: 5 MB, 100,000 triangles, 2048 px at most."
)
@click.option("--obj", type=PATH, metavar="FILE.obj", help="Also an OBJ file, with materials and pictures beside it.")
@click.option("-o", "folder", type=PATH, help="Where to; RUN/out/pictures, or `pictures` beside FILE.")
@quiet_option
@message_options
@pass_session
def render_command(
    session: Session,
    path: Path,
    views: list[str],
    size: int,
    turntable: Path | None,
    motion: Path | None,
    web: Path | None,
    obj: Path | None,
    folder: Path | None,
) -> None:
    """Draw what a run made, or a mesh, without a display: garments with their textures on the body, soft shadows.

    Pictures are three quarters as wide as they are high. An empty `--views ""` leaves only the turn or the files.
    Of a run, they hold garments and body. In the GLB, no vertex of a garment is inside the body.

    \b
    vto render runs/demo --views front,closeup
    vto render runs/demo --turntable demo.mp4
    vto render runs/walk --views "" --motion walk.mp4
    vto render runs/demo --views "" --web demo.glb
    vto render runs/demo --views "" --obj demo.obj
    """
    from vto_pipeline.cli.commands.render.draw import draw_motion, draw_turn, draw_views, meshes_of
    from vto_pipeline.cli.commands.render.obj import write_obj_files
    from vto_pipeline.cli.commands.render.parts import check_name
    from vto_pipeline.cli.commands.render.web import write_web
    from vto_pipeline.io.animations import animation_writer

    for moving in (turntable, motion):
        if moving is not None:
            animation_writer(moving)
    if web is not None:
        check_name(path, web, ".glb")
    if obj is not None:
        check_name(path, obj, ".obj")
    meshes, beside = meshes_of(path)
    written: dict[str, Any] = draw_views(session, meshes, views, size, folder or beside)
    if turntable is not None:
        written["turntable"] = draw_turn(session, meshes, turntable, size)
    if motion is not None:
        written["motion"] = draw_motion(session, path, motion, size)
    lines = [f"{name:10}{one['file']}  {one['seconds']:.1f} s" for name, one in written.items()]
    answer: dict[str, Any] = {"pictures": written}
    if web is not None:
        answer["web"] = made = write_web(path, web)
        lines.append(f"{'web':10}{made['file']}  {made['mb']:.1f} MB, {made['triangles']} triangles")
    if obj is not None:
        answer["obj"] = made = write_obj_files(path, obj)
        lines.append(f"{'obj':10}{made['file']}  {len(made['files'])} files, {made['triangles']} triangles")
    session.answer(answer, lines)
