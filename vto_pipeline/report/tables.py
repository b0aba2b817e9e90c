"""Rows of the page's tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vto_pipeline.model.body import Measurements


@dataclass(frozen=True)
class MeasurementRow:
    """One length of the body.

    Args:
        name: Its ISO 8559-1 name.
        value: Of the avatar [m]; mass in kg.
        sigma: Its standard uncertainty, or None when unknown.
        given: What the customer's file says, or None.
    """

    name: str
    value: float
    sigma: float | None
    given: float | None


def measurement_table(measured: Measurements | None, given: Measurements | None) -> list[MeasurementRow]:
    """Return what was measured on the avatar beside what was asked for, in the order of the measurements."""
    if measured is None:
        return []
    asked = {} if given is None else given.values
    return [
        MeasurementRow(name, value, measured.sigmas.get(name), asked.get(name))
        for name, value in measured.values.items()
    ]


def left_out_table(run_record: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what was not done and why: whole stages first, then parts of stages that ran."""
    stages = run_record.get("stages", [])
    whole = [(stage["name"], stage["reason"]) for stage in stages if stage["status"] == "left_out"]
    parts = [(f"{stage['name']}: {what}", why) for stage in stages for what, why in stage.get("left_out", [])]
    return whole + parts
