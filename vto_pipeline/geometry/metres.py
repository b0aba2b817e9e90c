"""Refuse a surface of unknown unit where metres are needed."""

from __future__ import annotations

from vto_pipeline.errors import ScanError
from vto_pipeline.model.mesh import TriangleMesh

HOW_TO_SCALE = (
    "give the mannequin that it was scanned on; or lay a printed board beside it and describe it in board.yaml; or "
    "state a length between two points of the photos (vto scan --distance, scale.lengths in a document), or the height "
    "of the person or form in them (--stature, scale.stature)"
)


def need_metres(surface: TriangleMesh, purpose: str) -> TriangleMesh:
    """Return the surface, if its lengths are metres.

    Args:
        surface: From wherever.
        purpose: What needs metres, for the message.

    Raises:
        ScanError: its scale is unknown.
    """
    if not surface.metric:
        raise ScanError(f"the scan has no scale: {purpose} needs metres", hint=HOW_TO_SCALE)
    return surface
