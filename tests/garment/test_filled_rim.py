"""An opening whose rim was filled for the most part is named, with its place."""

import numpy as np
import pytest

from vto_pipeline.garment.openings import warn_of_filled_rims
from vto_pipeline.model.garment import Opening
from vto_pipeline.model.job import Job


@pytest.mark.parametrize(("unseen", "warned"), [(3, False), (4, True), (10, True)])
def test_a_rim_of_which_a_third_was_filled_is_uncertain(unseen: int, warned: bool) -> None:
    observed, job = np.ones(30, bool), Job()
    loop = np.arange(5, 15, dtype=np.int32)
    observed[loop[:unseen]] = False
    opening = Opening(loop, 0.5767, np.array([0.01, 1.5, 0.03]), np.array([0.0, 1.0, 0.0]))
    warn_of_filled_rims([opening], observed, job)
    assert bool(job.warnings) == warned
    if warned:
        assert "577 mm at (0.01, 1.50, 0.03) m" in job.warnings[0]
        assert f"{10 * unseen} %" in job.warnings[0]
