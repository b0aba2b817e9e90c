"""The page of a batch: one row a run, sortable, in one self-contained file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vto_pipeline.report.wording import duration, number

_HERE = Path(__file__).parent

_TONE = {"done": "good", "waiting": ""}


def build_batch_page(batch: Mapping[str, Any], pages: Mapping[str, str]) -> str:
    """Return the summary of a batch as one HTML document; it refers to the pages of its rows and to nothing else.

    Args:
        batch: What batch.json holds.
        pages: Row -> relative address of its page, for those that have one.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"duration": duration, "number": number}
    return environment.from_string((_HERE / "batch.html").read_text(encoding="utf-8")).render(
        style=(_HERE / "page.css").read_text(encoding="utf-8"), batch=batch, pages=pages, tone=_TONE
    )
