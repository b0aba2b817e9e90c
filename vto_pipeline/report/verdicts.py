"""The verdicts at the top of the page: failures, warnings and fit."""

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


def fit_reports(parts: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the garments' fit reports by name; the name of an only garment is empty."""
    reports: Mapping[str, Any] = parts.get("fit_reports", {})
    return {"": parts["fit_report"]} if "fit_report" in parts else reports


def collect_verdicts(run_record: Mapping[str, Any], parts: Mapping[str, Any]) -> list[Verdict]:
    """Return all verdicts, the worst first; the order is otherwise that of the run."""
    found = []
    for stage in run_record.get("stages", []):
        if stage["status"] == "failed":
            found.append(Verdict("bad", f"failed: {stage['reason']}", stage["name"]))
        found += [Verdict("warn", warning, stage["name"]) for warning in stage.get("warnings", [])]
    for name, report in fit_reports(parts).items():
        tone = "warn" if any(zone["verdict"] in _POOR for zone in report.get("zones", [])) else "good"
        found.append(Verdict(tone, report["verdict"], f"fit of {name}" if name else "fit"))
    if "motion_report" in parts:
        report = parts["motion_report"]
        tight = any(one["most"] > report["stretch_limit"] for one in report["parts"].values())
        found.append(Verdict("warn" if tight else "good", report["verdict"], "fit"))
    for record in parts.get("pose_report", {}).get("poses", ()):
        tight = any(one["p95"] > record["stretch_limit"] for one in record.get("parts", {}).values())
        tone = "bad" if not record["reached"] else "warn" if tight else "good"
        found.append(Verdict(tone, record["verdict"], "fit"))
    if not found:
        found.append(Verdict("good", "No stage failed or gave a warning.", "run"))
    return sorted(found, key=lambda verdict: _ORDER.index(verdict.tone))
