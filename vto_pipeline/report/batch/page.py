"""The page of a batch: one row a run, sortable, in one self-contained file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vto_pipeline.report.document import document

_TONE = {"done": "good", "waiting": ""}


def build_batch_page(batch: Mapping[str, Any]) -> str:
    """Return the summary of a batch as one HTML document; it refers to the pages and pictures of its rows only.

    Args:
        batch: What batch.json holds; a row's `page` and `picture` are addresses relative to it, or empty.
    """
    return document("batch/batch.html", title="Batch", batch=batch, tone=_TONE)
