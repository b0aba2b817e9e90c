"""Output of the command line: data to stdout, everything else to stderr."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from vto_pipeline.errors import VtoError


@dataclass
class Session:
    """The values of the options that every command has.

    Args:
        json: One JSON document on stdout, and nothing else there.
        verbose: Say more.
        quiet: Say nothing but results and errors.
        log: File that receives each event as a line of JSON, or None.
        began: `time.perf_counter` when the command was given.
    """

    json: bool = False
    verbose: bool = False
    quiet: bool = False
    log: Path | None = None
    began: float = field(default_factory=time.perf_counter)

    def answer(self, data: Any, lines: Iterable[str]) -> None:
        """Print the command's result to stdout, as JSON if requested, else as plain lines."""
        if self.json:
            click.echo(json.dumps(data, indent=1, ensure_ascii=False))
        else:
            for line in lines:
                click.echo(line)

    def say(self, text: str) -> None:
        """Print a message to stderr."""
        if not self.quiet:
            click.echo(text, err=True)

    def enter(self, event: str, **fields: Any) -> None:
        """Append an event to the log, with its time in UTC.

        Raises:
            OSError: it cannot be written.
        """
        if self.log is not None:
            now = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
            with self.log.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps({"time": now, "event": event, **fields}, ensure_ascii=False) + "\n")

    def fail(self, error: VtoError) -> int:
        """Report an error; returns its exit code."""
        click.echo(str(error), err=True)
        self.answer_error(error)
        with suppress(OSError):  # the log may be what is at fault
            self.enter("error", **_fields(error), exit_code=error.exit_code)
        return error.exit_code

    def answer_error(self, error: VtoError) -> None:
        """Print an error to stdout, if JSON was requested."""
        if self.json:
            self.answer({"error": _fields(error), "exit_code": error.exit_code}, ())


def _fields(error: VtoError) -> dict[str, Any]:
    return {"kind": type(error).__name__, "problem": error.problem, "where": error.where, "hint": error.hint}


pass_session = click.make_pass_decorator(Session, ensure=True)
"""Gives a command its session."""
