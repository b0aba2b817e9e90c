"""vto pattern.

command: the command
lines, flat_lines: a sewing pattern in tables and as JSON; its flat measurements
unsewn: a garment in space taken apart
graded: a pattern in other sizes
"""

from vto_pipeline.cli.commands.pattern.command import pattern_command

__all__ = ["pattern_command"]
