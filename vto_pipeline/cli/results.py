"""What a run found, in words: its files, girths with their uncertainty, and how a garment fits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

from vto_pipeline.cli.progress import show_progress
from vto_pipeline.cli.session import Session
from vto_pipeline.cli.tables import table_lines
from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import read_json
from vto_pipeline.model.body import Measurements
from vto_pipeline.pipeline.execution.budget import TimeBudget
from vto_pipeline.pipeline.execution.folder import RECORD
from vto_pipeline.report.budgets import budget_lines
from vto_pipeline.stages.entry.commands import run_order
from vto_pipeline.stages.entry.documents import Order
from vto_pipeline.stages.entry.outcome import Outcome

_COVERED = 1.96
"""Standard deviations on either side that hold 95 % of a normal distribution."""


def perform(session: Session, order: Order, time_budget: float | None = None, **options: Any) -> None:
    """Run a document, and print the outcome to stdout.

    Args:
        session: Of the command line.
        order: What to run.
        time_budget: Wall time of the command [s].
        options: As `run_order` takes them, besides.

    Raises:
        VtoError: of whatever kind.
    """
    for note in order.notes:
        session.say(note)
    before = {} if options.get("output") else _given_in(order.folder)
    with show_progress(session) as listener:
        whole = None if time_budget is None else TimeBudget(time_budget, session.began)
        outcome = run_order(order, listener=listener, time_budget=whole, **options)
    if other := [one["key"] for name, one in outcome.record["given"].items() if before.get(name, one) != one]:
        session.say(
            f"{outcome.folder} held the result of another {', '.join(other)}; it holds this one now. "
            "To keep both, name a folder for each with -o"
        )
    session.enter("done", run=str(outcome.folder), seconds=outcome.seconds, verdicts=outcome.verdicts)
    session.answer({**outcome.record, "run": str(outcome.folder)}, chain(outcome_lines(outcome), result_lines(outcome)))


def _given_in(folder: Path) -> dict[str, Any]:
    """Return what the last run in a folder was given, as run.json holds it; nothing where there was none."""
    try:
        return dict(read_json(folder / RECORD)["given"])
    except (InputError, KeyError, TypeError, ValueError):  # none yet, or not ours
        return {}


def outcome_lines(outcome: Outcome) -> Iterator[str]:
    """Yield what became of the stages, where the wanted files are, and all warnings."""
    record = outcome.record
    ended = all(stage["status"] not in ("planned", "failed") for stage in record["stages"])
    yield f"{'done in' if ended else 'not done after'} {outcome.seconds:.1f} s; {stage_counts(record)}"
    width = max(len(artifact) for artifact in record["wanted"])
    for artifact in record["wanted"]:
        absent = "as given" if artifact in record["given"] else "not made"
        yield f"  {artifact:<{width}}  {outcome.path(artifact) if outcome.made(artifact) else absent}"
    trace = outcome.read("trace") if outcome.made("trace") else ()
    yield from (f"  {line}" for line in budget_lines(record, trace))
    for name, text in outcome.warnings:
        yield f"  warning from {name.replace('_', ' ')}: {text}"


def stage_counts(record: Mapping[str, Any]) -> str:
    """Return how many stages ended which way, in words."""
    states = [stage["status"] for stage in record["stages"]]
    words = {"ran": "ran", "cached": "from the cache", "left_out": "left out"}
    others = {"failed": "failed", "planned": "not begun or not ended"}
    words |= {state: text for state, text in others.items() if state in states}
    return "stages: " + ", ".join(f"{states.count(state)} {text}" for state, text in words.items())


def result_lines(outcome: Outcome) -> Iterator[str]:
    """Yield the result of each wanted artifact that has one in words."""
    if "measurements" in outcome.record["wanted"] and outcome.made("measurements"):
        yield from table_lines(("girth", "cm", "± cm (95 %)"), _girths(outcome.read("measurements")))
    if "motion_audit" in outcome.record["wanted"] and outcome.made("motion_audit"):
        yield from motion_lines(outcome.read("motion_audit"))
    yield from outcome.verdicts


def motion_lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield how a garment followed a motion, from what motion_audit.json holds."""
    yield (
        f"motion: {found['frames']} frames; the garment crosses the body in {found['frames_crossing_body']} and itself "
        f"in {found['frames_crossing_itself']}"
    )
    if found["frames_body_crossing_itself"]:
        yield (
            f"  the body passes through itself in {found['frames_body_crossing_itself']} frames; its skin gives way "
            f"there by up to {found['body_yields_mm']:.0f} mm"
        )
    yield (
        f"  at most {found['penetration_mm']:.1f} mm inside the body; threads stretched by up to "
        f"{found['max_thread_stretch']:.0%}, on 99% of the cloth by up to {found['p99_thread_stretch']:.0%}, and "
        f"sheared by up to {found['max_shear_deg']:.0f} degrees; {found['seconds_per_frame']:.1f} s a frame"
    )
    if found["frames_overstretched"]:
        yield (
            f"  stretched as no cloth can be in {found['frames_overstretched']} frames, an edge by up to "
            f"{found['max_stretch']:.0%}: too small for this motion, or caught"
        )
    yield f"  cloth beyond what its fabric is known to bear, at most in a frame: {_beyond(found)}"


def _beyond(found: Mapping[str, Any]) -> str:
    """Return in words how much of the cloth is beyond the limits of warp, weft and shear in motion_audit.json."""
    shares = found["beyond_limits"].items()
    known = [f"{share:.1%} by its {name}" for name, share in shares if share is not None]
    lacking = [name for name, share in shares if share is None]
    return ", ".join(known + ([f"not known of {' and '.join(lacking)}"] if lacking else []))


def _girths(measured: Measurements) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and half the 95 % interval of stature and of each girth; "-" where that is unknown."""
    for name, value in measured.values.items():
        if name == "stature" or name.endswith("_girth"):
            sigma = measured.sigmas.get(name)
            spread = "-" if sigma is None else f"{100 * _COVERED * sigma:.1f}"
            yield name.removesuffix("_girth").replace("_", " "), f"{100 * value:.1f}", spread
