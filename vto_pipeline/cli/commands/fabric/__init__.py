"""vto fabric."""

from vto_pipeline.cli.commands.fabric.command import fabric_command

__all__ = ["fabric_command"]
