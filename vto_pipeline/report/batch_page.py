"""The page of a batch: one row a run, sortable, in one self-contained file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vto_pipeline.report.wording import duration, number

_HERE = Path(__file__).parent

_TONE = {"done": "good", "waiting": ""}


def build_batch_page(batch: Mapping[str, Any]) -> str:
    """Return the summary of a batch as one HTML document; it refers to the pages and pictures of its rows only.

    Args:
        batch: What batch.json holds; a row's `page` and `picture` are addresses relative to it, or empty.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"duration": duration, "number": number}
    return environment.from_string((_HERE / "batch.html").read_text(encoding="utf-8")).render(
        style=(_HERE / "page.css").read_text(encoding="utf-8"), batch=batch, tone=_TONE
    )
