"""Output of the command line: data to stdout, everything else to stderr."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import click

from vto_pipeline.errors import VtoError


@dataclass
class Session:
    """The values of the options that every command has.

    Args:
        json: One JSON document on stdout, and nothing else there.
        verbose: Say more.
    """

    json: bool = False
    verbose: bool = False

    def answer(self, data: Any, lines: Iterable[str]) -> None:
        """Print the command's result to stdout, as JSON if requested, else as plain lines."""
        if self.json:
            click.echo(json.dumps(data, indent=1, ensure_ascii=False))
        else:
            for line in lines:
                click.echo(line)

    def say(self, text: str) -> None:
        """Print a message to stderr."""
        click.echo(text, err=True)

    def fail(self, error: VtoError) -> int:
        """Report an error; returns its exit code."""
        self.say(str(error))
        self.answer_error(error)
        return error.exit_code

    def answer_error(self, error: VtoError) -> None:
        """Print an error to stdout, if JSON was requested."""
        if self.json:
            fields = {"kind": type(error).__name__, "problem": error.problem, "where": error.where, "hint": error.hint}
            self.answer({"error": fields, "exit_code": error.exit_code}, ())


pass_session = click.make_pass_decorator(Session, ensure=True)
"""Gives a command its session."""
