"""Patterns by others as they start: ipctk finds no crossing, even in jackets and hoods, whose fronts are open."""

from __future__ import annotations

import ipctk
import numpy as np
import pytest
from size_shapes import FOREIGN
from slow_cases import every

from vto_pipeline.garment.pattern.embed import in_shape
from vto_pipeline.garment.pattern.sew import SewConfig, sew
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.model.job import Job

PATTERNS = sorted(FOREIGN.rglob("*.json"))


@pytest.mark.real_data
@pytest.mark.skipif(not PATTERNS, reason="shared data absent")
@pytest.mark.parametrize("path", every(4, PATTERNS), ids=lambda path: path.stem)
def test_patterns_of_others_start_without_crossing_themselves(path):
    job = Job()
    mesh = in_shape(sew(read_pattern(path), SewConfig(edge_mm=30.0), job), job)
    assert not ipctk.has_intersections(
        ipctk.CollisionMesh(mesh.vertices, ipctk.edges(mesh.faces), mesh.faces), np.asfortranarray(mesh.vertices)
    )
    if path.parent.name == "basic tee":  # others are gathered into bands
        assert max(abs(job.metrics[f"stretch_p{p}_share"]) for p in ("01", "99")) < 0.04  # the drape takes it out
