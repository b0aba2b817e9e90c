"""vto view.

command: the command
server: the page of a run, served to a browser of this machine
"""

from vto_pipeline.cli.commands.view.command import view_command

__all__ = ["view_command"]
