"""What the judge of a drape finds is shown where it is."""

import json
import re
from base64 import b64decode

import numpy as np
from numpy.testing import assert_allclose

from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.stages.output import STAGES

PAGE = next(stage for stage in STAGES if stage.name == "page")
CLOTH = TriangleMesh(np.array([[0.0, 1, 0], [1, 1, 0], [0, 1, 1]]), [[0, 1, 2]])


def scene(audit):
    made = PAGE.run({"run_record": {}, "draped": CLOTH, "audit": audit}, Config(), Job())["page"]
    return json.loads(re.search(r'id="scene">(.*?)</script>', made)[1])


def test_a_ball_marks_each_place_where_cloth_crosses_the_body_or_itself():
    found = scene({"body_intersection_places": [[0.1, 1.0, 0.2]], "self_intersection_places": [[0.5, 1.2, 0.3]]})
    marks = next(layer for layer in found["layers"] if layer["name"] == "Crossings")
    assert marks["visible"]
    packed = found["geometries"][marks["geometry"]]
    grid = np.frombuffer(b64decode(packed["positions"]), "<u2").reshape(-1, 4)[:, :3]
    points = np.array(packed["low"]) + np.array(packed["size"]) * grid / 65535
    for place in ([0.1, 1.0, 0.2], [0.5, 1.2, 0.3]):
        near = np.linalg.norm(points - place, axis=1) < 0.02
        assert_allclose(points[near].mean(axis=0), place, rtol=0, atol=2e-3)  # poles count once for each longitude


def test_without_crossings_there_are_no_marks():
    found = scene({"body_intersection_places": [], "self_intersection_places": []})
    assert [layer["name"] for layer in found["layers"]] == ["Simulated cloth"]
