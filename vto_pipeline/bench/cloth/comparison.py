"""Rows of other programs on the same scenes, and run times at equal error.

Such a row is one JSON line with at least scene ("hang" or "sphere"), N, peer, params, seconds, rms_stretch and com_z
[m], from two seconds of the scenes of `bench.cloth.scenes`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vto_pipeline.bench.bench import Row, Value
from vto_pipeline.errors import FormatError
from vto_pipeline.io.files import check_file

ERROR = "rms_stretch"
HEIGHT_TOLERANCE = 0.01
"""A sheet whose mean height is farther from the reference has not fallen, or has stretched or slid away [m]."""

_WANTED = ("scene", "N", "peer", "params", "seconds")
_BYTES = 100_000_000


@dataclass(frozen=True)
class ErrorLevel:
    """What an error costs.

    Args:
        scene: Where.
        error: Relative edge stretch, rms.
        peer, peer_settings: The fastest row measured elsewhere that reaches it.
        peer_seconds: Its time [s].
        method, settings: The fastest row of ours that reaches it; empty if none does.
        seconds: Its time [s], or None.
    """

    scene: str
    error: float
    peer: str
    peer_settings: dict[str, Value]
    peer_seconds: float
    method: str = ""
    settings: dict[str, Value] | None = None
    seconds: float | None = None

    @property
    def ratio(self) -> float | None:
        """Our time as a share of the peer's; None if we do not get there."""
        return None if self.seconds is None else self.seconds / self.peer_seconds


def read_peers(path: Path) -> list[Row]:
    """Return the rows of a file that ended finite.

    Raises:
        FormatError: a line is not such a row.
        InputError: no such file.
    """
    found = []
    text = check_file(path, {".jsonl"}, _BYTES).read_text(encoding="utf-8")
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        where = f"{path}, line {number}"
        try:
            plain = json.loads(line)
            missing = [name for name in _WANTED if name not in plain]
        except (ValueError, TypeError):
            raise FormatError("not a JSON object", where=where) from None
        if missing:
            raise FormatError(f"a row without {', '.join(missing)}", where=where, hint=f"expected {', '.join(_WANTED)}")
        if "com_z" in plain and ERROR in plain:  # a run that blew up has neither
            found.append(_peer_row(plain))
    return found


def compare(rows: Iterable[Row], peers: Sequence[Row]) -> list[ErrorLevel]:
    """Return one level for each error that a peer reaches, tightest last in each scene.

    Rows count only if the mean height is within HEIGHT_TOLERANCE of the scene's reference.
    """
    ours = list(rows)
    levels = []
    for scene in dict.fromkeys(row.scene for row in peers):
        heights = [_figure(row, "mean_height_m") for row in ours if row.scene == scene and row.method == "reference"]
        if not heights:
            continue
        fair = [row for row in peers if row.scene == scene and _fell(row, heights)]
        mine = [row for row in ours if row.scene == scene and row.method != "reference" and _fell(row, heights)]
        for error in sorted({_figure(row, ERROR) for row in fair}, reverse=True):
            levels.append(_level(scene, error, fair, mine))
    return levels


def level_as_json(level: ErrorLevel) -> dict[str, Any]:
    """Return plain values."""
    return {**asdict(level), "ratio": level.ratio}


def _level(scene: str, error: float, peers: Iterable[Row], ours: Iterable[Row]) -> ErrorLevel:
    peer = min((row for row in peers if _figure(row, ERROR) <= error), key=lambda row: row.seconds)
    known = ErrorLevel(scene, error, peer.method, dict(peer.settings), peer.seconds)
    reached = [row for row in ours if _figure(row, ERROR) <= error]
    if not reached:
        return known
    best = min(reached, key=lambda row: row.seconds)
    return ErrorLevel(
        scene, error, peer.method, known.peer_settings, peer.seconds, best.method, dict(best.settings), best.seconds
    )


def _fell(row: Row, heights: Sequence[float]) -> bool:
    """Return whether the sheet hangs where one of the references does."""
    height = row.errors.get("mean_height_m")
    return isinstance(height, float) and min(abs(height - known) for known in heights) <= HEIGHT_TOLERANCE


def _figure(row: Row, name: str) -> float:
    value = row.errors.get(name)
    return float(value) if isinstance(value, int | float) else float("inf")


def _peer_row(plain: dict[str, Any]) -> Row:
    errors: dict[str, Value] = {ERROR: plain[ERROR], "mean_height_m": plain["com_z"]}
    for theirs, ours in (("max_stretch", "max_stretch"), ("ke", "kinetic_j"), ("pen_s_mm", "penetration_mm")):
        if plain.get(theirs) is not None:
            errors[ours] = plain[theirs]
    return Row(
        f"{plain['scene']} {plain['N']}",
        plain["peer"],
        plain["params"],
        plain["N"] ** 2,
        plain["seconds"],
        errors,
        runs=plain.get("reps", 1),
        threads=plain.get("threads_asked") or 0,
    )
