"""The command `vto view`."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("view")
@click.argument("folder", metavar="RUN", type=PATH)
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Of the address; by default any that is free.")
@click.option("--no-browser", is_flag=True, help="Only say the address.")
@message_options
@pass_session
def view_command(session: Session, folder: Path, port: int, no_browser: bool) -> None:
    """Show the page of a run, with its 3D view, in the browser; it loads again whenever the run is made anew.

    It is served to this machine only, until Ctrl-C.

    \b
    vto view runs/demo
    """
    import webbrowser

    from vto_pipeline.cli.commands.view.server import page_server

    with page_server(folder, port) as server:
        address = f"http://127.0.0.1:{server.server_port}/"
        session.answer({"address": address, "run": str(folder)}, [f"{folder}: {address}  (Ctrl-C ends it)"])
        if not no_browser:
            webbrowser.open(address)
        with suppress(KeyboardInterrupt):  # the way to end it
            server.serve_forever()
