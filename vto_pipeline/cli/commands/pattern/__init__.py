"""vto pattern.

command: the command
lines: a sewing pattern in tables and as JSON
"""

from vto_pipeline.cli.commands.pattern.command import pattern_command

__all__ = ["pattern_command"]
