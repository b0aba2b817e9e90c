"""vto motion.

command: the command
lines: what a motion is and how it came out, in a table and as JSON
"""

from vto_pipeline.cli.commands.motion.command import motion_command

__all__ = ["motion_command"]
