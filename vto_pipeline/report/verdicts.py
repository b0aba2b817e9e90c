"""What a reader must know first: what failed, what is poor, what the garment does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Verdict:
    """One line at the top of the page.

    Args:
        tone: "bad", "warn" or "good".
        text: What.
        where: Stage or report it comes from.
    """

    tone: str
    text: str
    where: str


_ORDER = ("bad", "warn", "good")
_POOR = ("stretched", "tight", "loose")


def collect_verdicts(run_record: Mapping[str, Any], parts: Mapping[str, Any]) -> list[Verdict]:
    """Return all verdicts, the worst first; the order is otherwise that of the run."""
    found = []
    for stage in run_record.get("stages", []):
        if stage["status"] == "failed":
            found.append(Verdict("bad", f"failed: {stage['reason']}", stage["name"]))
        found += [Verdict("warn", warning, stage["name"]) for warning in stage.get("warnings", [])]
    if "fit_report" in parts:
        zones = parts["fit_report"].get("zones", [])
        tone = "warn" if any(zone["verdict"] in _POOR for zone in zones) else "good"
        found.append(Verdict(tone, parts["fit_report"]["verdict"], "fit"))
    if not found:
        found.append(Verdict("good", "No stage failed or gave a warning.", "run"))
    return sorted(found, key=lambda verdict: _ORDER.index(verdict.tone))
