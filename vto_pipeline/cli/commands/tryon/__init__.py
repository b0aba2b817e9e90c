"""vto tryon.

command: the command
"""

from vto_pipeline.cli.commands.tryon.command import tryon_command

__all__ = ["tryon_command"]
