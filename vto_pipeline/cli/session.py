"""How the command line speaks: data to stdout, everything else to stderr."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import click

from vto_pipeline.errors import VtoError


@dataclass
class Session:
    """What the options every command has ask for.

    Args:
        json: One JSON document on stdout, and nothing else there.
        verbose: Say more.
    """

    json: bool = False
    verbose: bool = False

    def answer(self, data: Any, lines: Iterable[str]) -> None:
        """Put the command's result on stdout: as JSON if that was asked for, else as lines for people."""
        if self.json:
            click.echo(json.dumps(data, indent=1, ensure_ascii=False))
        else:
            for line in lines:
                click.echo(line)

    def say(self, text: str) -> None:
        """Put a message on stderr."""
        click.echo(text, err=True)

    def fail(self, error: VtoError) -> int:
        """Report an error; returns its exit code."""
        self.say(str(error))
        self.answer_error(error)
        return error.exit_code

    def answer_error(self, error: VtoError) -> None:
        """Put an error on stdout, if JSON was asked for."""
        if self.json:
            fields = {"kind": type(error).__name__, "problem": error.problem, "where": error.where, "hint": error.hint}
            self.answer({"error": fields, "exit_code": error.exit_code}, ())


pass_session = click.make_pass_decorator(Session, ensure=True)
"""Gives a command its session."""
