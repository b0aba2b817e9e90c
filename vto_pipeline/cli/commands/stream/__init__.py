"""vto stream.

command: the command
lines: how it went, as a table
"""

from vto_pipeline.cli.commands.stream.command import stream_command

__all__ = ["stream_command"]
