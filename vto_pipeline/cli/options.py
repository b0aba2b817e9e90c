"""Options that several commands share, each defined once."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from vto_pipeline.cli.session import Session

Function = TypeVar("Function", bound=Callable[..., Any])

PATH = click.Path(path_type=Path)
"""A path that the engine checks, so that all commands complain in the same words."""


def _set_json(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    ctx.ensure_object(Session).json |= value


def _set_quiet(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    ctx.ensure_object(Session).quiet |= value


def _set_log(ctx: click.Context, _: click.Parameter, value: Path | None) -> None:
    if value is not None:
        try:
            value.open("a").close()
        except OSError as error:
            raise click.BadParameter(f"cannot be written: {error.strerror}") from None
        ctx.ensure_object(Session).log = value


def _set_verbose(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    ctx.ensure_object(Session).verbose |= value
    logging.basicConfig(level=logging.INFO if value else logging.WARNING, format="%(name)s: %(message)s")


json_option = click.option(
    "--json", is_flag=True, expose_value=False, is_eager=True, callback=_set_json, help="Print one JSON document."
)
verbose_option = click.option(
    "-v", "--verbose", is_flag=True, expose_value=False, is_eager=True, callback=_set_verbose, help="Print details."
)
quiet_option = click.option(
    "-q", "--quiet", is_flag=True, expose_value=False, is_eager=True, callback=_set_quiet, help="Print the result only."
)
log_option = click.option(
    "--log",
    type=PATH,
    expose_value=False,
    is_eager=True,
    callback=_set_log,
    metavar="FILE",
    help="Append what happens to FILE, one JSON document a line.",
)
set_option = click.option(
    "--set", "overrides", multiple=True, metavar="STAGE.KEY=VALUE", help="Change one setting; may be repeated."
)
output_option = click.option(
    "-o", "--output", type=PATH, metavar="RUN", help="Run folder, created if missing. [default: runs/NAME]"
)
until_option = click.option("--until", metavar="STAGE", help="Stop after this stage; `vto plan` lists them.")
afresh_option = click.option(
    "--from", "afresh", metavar="STAGE", help="Make this stage and all that depends on it anew, stored or not."
)
force_option = click.option("--force-all", is_flag=True, help="Leave no work out, for comparison.")


def message_options(function: Function) -> Function:
    """Add --json and -v, which every command has."""
    return json_option(verbose_option(function))


def pipeline_options(function: Function) -> Function:
    """Add the options of every command that runs a pipeline; `perform` takes them."""
    own = until_option(afresh_option(force_option(log_option(quiet_option(message_options(function))))))
    return output_option(set_option(own))
