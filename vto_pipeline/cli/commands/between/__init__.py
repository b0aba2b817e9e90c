"""vto between."""

from vto_pipeline.cli.commands.between.command import between_command

__all__ = ["between_command"]
