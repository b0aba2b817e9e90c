"""Documents of one file, from their templates: all in one frame, with one style."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vto_pipeline.report.wording import centimetres, duration, figure, label, number

if TYPE_CHECKING:
    from jinja2 import Environment

_HERE = Path(__file__).parent


def document(template: str, **values: Any) -> str:
    """Return an HTML document without references to anything outside.

    Args:
        template: In this folder; it extends frame.html.
        values: What it asks for; the style and the 3D viewer are there.
    """
    made = _environment().get_template(template)
    return made.render(style=asset("page.css"), viewer=asset("viewer.js"), **values)


def asset(name: str) -> str:
    """Return a file of this folder as text."""
    return (_HERE / name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    """Return the templates, each compiled once: that takes longer than to write most pages."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(_HERE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"cm": centimetres, "duration": duration, "label": label, "number": number}
    environment.globals |= {"figure": figure}
    return environment
