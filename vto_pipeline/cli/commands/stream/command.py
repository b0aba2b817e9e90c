"""vto stream"""

from __future__ import annotations

import sys
from contextlib import suppress
from itertools import count
from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, Quantity, message_options
from vto_pipeline.cli.session import Session, pass_session
from vto_pipeline.units import LENGTH_M, TIME_S

_UP = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
_SAID = 5
"""Refused lines that are told one by one; then they are only counted."""


@click.command("stream")
@click.argument("folder", metavar="RUN", type=PATH)
@click.option("--rate", type=click.FloatRange(1, 120), default=20.0, show_default=True, help="Frames per second.")
@click.option(
    "--vertices", type=click.IntRange(100, 20000), default=1500, show_default=True, help="Of the cloth, about."
)
@click.option("--lead-in", type=Quantity(TIME_S), default="1s", show_default=True, help="From the pose of the drape.")
@click.option("--replay", is_flag=True, help="Take each line when its time has come: for a recording.")
@click.option("--unit", type=click.Choice(sorted(LENGTH_M)), help="Unit of length. [default: found from the legs]")
@click.option("--up", type=click.Choice(_UP), help="Axis that points up. [default: found from the body]")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve the page on.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Of the address; by default any that is free.")
@click.option("--no-browser", is_flag=True, help="Only say the address.")
@message_options
@pass_session
def stream_command(
    session: Session,
    folder: Path,
    rate: float,
    vertices: int,
    lead_in: float,
    replay: bool,
    unit: str | None,
    up: str | None,
    host: str,
    port: int,
    no_browser: bool,
) -> None:
    """Move the avatar of a run, and its garment, as a person before a camera moves.

    RUN is a folder that `vto drape` made, on an avatar. Standard input holds joints as JSON lines, as for
    `vto motion -`. A page shows the frames; a browser that loses it connects again and gets the newest.
    Where lines come faster than frames, the newest counts; where none come, the pose is held. Ends with the input, or
    with Ctrl-C, and says how it went.

    \b
    depth_camera | vto stream runs/shirt
    vto stream runs/shirt --replay < walk.jsonl
    """
    import webbrowser

    from vto_pipeline.avatar.motion.live import LivePose
    from vto_pipeline.cli.commands.stream.lines import stream_lines
    from vto_pipeline.cloth.moving.live import LiveCloth
    from vto_pipeline.errors import FormatError
    from vto_pipeline.io.motion.tracked.feed import Feed
    from vto_pipeline.model.job import Job
    from vto_pipeline.report.live.server import LiveServer
    from vto_pipeline.stages.entry.live import LiveReport, follow_live, worn
    from vto_pipeline.stages.entry.outcome import open_run

    told = count()

    def refused(error: FormatError) -> None:
        if next(told) < _SAID:
            session.say(f"refused: {error.problem} in {error.where}")

    dressed, job, report = worn(open_run(folder), vertices), Job(), LiveReport()
    with LiveServer(dressed.page.html, host, port) as server:
        session.say(f"{folder}: {server.address}  (Ctrl-C ends it)")
        if not no_browser:
            webbrowser.open(server.address)
        session.say("compiling the kernels")
        cloth = LiveCloth(dressed.garment, dressed.avatar.mesh, dressed.fabric)
        cloth.advance(dressed.avatar.vertices, 1.0 / rate)
        pose = LivePose(dressed.avatar, lead_in, unit=unit, up=up, job=job)
        feed = Feed(sys.stdin.buffer, "standard input", refused, replay=replay)
        session.say(f"{len(cloth.positions)} vertices, ready for skeletons")
        with suppress(KeyboardInterrupt):  # the way to end it
            follow_live(dressed, cloth, pose, feed, rate, server.show, report)
    shown = {"browsers": server.joined, "frames_sent": server.sent, "frames_left_out": server.left_out}
    found = report.figures(cloth, feed) | shown
    session.answer(found | {"notes": job.notes, "warnings": job.warnings}, [*stream_lines(found), *job.notes])
