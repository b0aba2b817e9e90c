"""vto fabric.

command: the options; from strips
draped: from a drape test
"""

from vto_pipeline.cli.commands.fabric.command import fabric_command

__all__ = ["fabric_command"]
