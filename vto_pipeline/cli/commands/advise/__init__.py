"""vto advise."""

from vto_pipeline.cli.commands.advise.command import advise_command

__all__ = ["advise_command"]
