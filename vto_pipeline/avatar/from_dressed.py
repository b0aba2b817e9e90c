"""A mannequin that was never scanned bare: estimated inside the scan of what it wears, from what is known of it."""

from __future__ import annotations

import numpy as np

from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.geometry.metres import need_metres
from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

FACES = 60_000
"""Of the scan that the body is fitted to: it is known to a centimetre, and a finer one takes only time."""
AWAY_M = 0.06
"""A quarter of an estimated body lies nearer to its scan than this, whatever it wears."""


def fit_dressed(scan: TriangleMesh, tape: Measurements, config: ScanConfig, job: Job) -> Avatar:
    """Return the body inside the scan of a dressed mannequin, in the scan's own frame, posed as it stands there.

    What the tape says is held. The rest follows from the people whom the clothes fit.

    Args:
        scan: Dressed mannequin, +Y up [m].
        tape: What is known of the mannequin: its stature, or more.
        config: Of the registration; its sex counts where the tape does not say.
        job: As for `fit_scan`.

    Raises:
        AvatarError: no body is found in the scan, or +Y is not up.
        ScanError: the scan's unit is unknown.
    """
    sex = config.sex if tape.sex == "neutral" else tape.sex
    dressed = config.model_copy(update={"sex": sex, "clothed": True})
    light = decimate(need_metres(scan, "estimating a mannequin inside its clothes"), FACES)
    avatar = fit_scan(light, dressed, job, tape)
    away = closest_points(avatar.vertices[::5], light.vertices, light.faces)[2]
    if np.quantile(away, 0.25) > AWAY_M:
        raise AvatarError(
            "the mannequin was found in a scan that was turned first: +Y is not up in it",
            hint="turn the scan so that +Y is up, and its unit is the metre",
        )
    return avatar
