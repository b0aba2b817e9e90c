"""The table: every stage, every artifact, and what may be given.

scan, garment, avatar, cloth, motion, poses, scan_report, output: the rows, by subject
levels: what stages take, and what a time budget may run them at
roles: rows that serve garment, mannequin and body alike
outfit, outfit_page: several garments in one document
entry: the ways in to the tables
"""

from __future__ import annotations

from vto_pipeline.io.runs.artifacts import ARTIFACTS
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.stages import avatar, cloth, garment, motion, output, poses, scan, scan_report
from vto_pipeline.stages.levels import with_levels
from vto_pipeline.stages.roles import ROLES

_SCANNED = ("photos", "video", "depth", "cloud", "surface")

GIVEN = {
    **{f"{role}.{kind}": f"{role}_{kind}" for role in ROLES for kind in _SCANNED},
    "garment.mesh": "garment_mesh",
    "garment.pattern": "garment_pattern",
    "mannequin.measurements": "mannequin_measurements",
    "mannequin.avatar": "source_avatar",
    "mannequin.dressed": "dressed_measurements",
    "body.measurements": "body_measurements",
    "body.silhouettes": "body_silhouettes",
    "body.avatar": "fitted_avatar",
    "body.mesh": "body_mesh",
    "fabric": "fabric",
    "motion": "motion",
    "lifelike": "lifelike_data",
}
"""Key under `given:` in a document -> artifact."""

CATALOGUE = Catalogue(
    stages=tuple(
        with_levels(row)
        for rows in (scan, garment, avatar, cloth, motion, poses, scan_report, output)
        for row in rows.STAGES
    ),
    kinds=ARTIFACTS,
    given=GIVEN,
)
