"""vto render.

command: the command
draw: pictures of views, and of a turn
parts: what goes into files for other programs
web, obj: a file for web pages; an OBJ file
"""

from vto_pipeline.cli.commands.render.command import render_command

__all__ = ["render_command"]
