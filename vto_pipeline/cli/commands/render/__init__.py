"""vto render.

command: the command
draw: pictures of views, and of a turn
web: a file for web pages
"""

from vto_pipeline.cli.commands.render.command import render_command

__all__ = ["render_command"]
