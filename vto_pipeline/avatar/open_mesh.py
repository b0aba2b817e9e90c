"""A garment that was given as a body: it is open where its wearer goes in and comes out."""

from __future__ import annotations

from vto_pipeline.avatar.from_scan import ScanConfig, begin_registration
from vto_pipeline.avatar.scan.report import CUFFS, refuse_garment, wide_openings
from vto_pipeline.avatar.scan.upright import candidate_up_rotations
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_PROBES = 1000


def refuse_open_mesh(body: TriangleMesh) -> None:
    """Refuse a body mesh that is a garment, before anything is draped on it: that takes minutes to fail.

    Only what is open as garments are is asked for the parts of a person. Holes make no garment of a body. A skirt
    passes: it is open in two places only, as a form may be.

    Args:
        body: In metres, any axis up.

    Raises:
        AvatarError: it looks like a garment.
    """
    if wide_openings(body) < CUFFS or not candidate_up_rotations(body):
        return
    begun = begin_registration(body, ScanConfig(probes=_PROBES), Job())
    refuse_garment(begun.scan, begun.space, begun.posed)
