"""How a live session went, as a table."""

from __future__ import annotations

from typing import Any

from vto_pipeline.cli.tables import table_lines


def stream_lines(found: dict[str, Any]) -> list[str]:
    """Return the figures of `LiveReport` and of the server as a table."""
    rows = [
        ("frames", f"{found['frames']} in {found['seconds']:.1f} s: {found['frames_per_second']:.1f} a second"),
        ("time of a frame", f"{found['frame_ms_median']:.0f} ms, 95 % under {found['frame_ms_p95']:.0f} ms"),
        ("left out, since one took too long", str(found["late"])),
        ("with no new skeleton, pose held", str(found["held"])),
        ("skeletons", f"{found['skeletons']}, {found['skeletons_skipped']} of them skipped for a newer one"),
        ("lines refused", str(found["lines_refused"])),
        ("cloth", f"{found['vertices']} vertices"),
        ("deepest in the body", f"{found['penetration_mm']:.1f} mm"),
        ("garment laid on anew", str(found["restarts"])),
        ("browsers", f"{found['browsers']}, {found['frames_sent']} frames sent, {found['frames_left_out']} left out"),
    ]
    return table_lines(("", ""), rows)[2:]
