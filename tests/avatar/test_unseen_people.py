"""What a scan does not show is no surer than people differ in it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.measuring.population import population
from vto_pipeline.avatar.scan.correspondence import Target
from vto_pipeline.avatar.scan.uncertainty.people import as_people_differ, open_shares
from vto_pipeline.avatar.template.template import beyond_armscye, template
from vto_pipeline.geometry.topology import face_normals, submesh
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh

BODIES = Path(__file__).parents[3] / "shared" / "data" / "bodies"
BODY: Avatar = template(1.0)
FRONT = face_normals(BODY.mesh)[:, 2] > 0.0
SURE = dict.fromkeys(measure(BODY).values, 0.001)


def seen(faces: np.ndarray) -> Target:
    return Target(submesh(BODY.mesh, faces)[0], 500, 0)


def test_what_is_seen_stays_as_sure_as_it_is() -> None:
    whole = Target(BODY.mesh, 500, 0)
    assert set(open_shares(BODY, whole).values()) == {0.0}
    assert as_people_differ(BODY, SURE, whole) == SURE


def test_an_arm_far_from_the_scan_is_open_and_its_other_half_is_not() -> None:
    """Closed form: a wrist half a metre off the scan is free; the mean of both arms has half of that, taken twice."""
    without = ~beyond_armscye()[BODY.faces].any(axis=1)
    left = BODY.bind_vertices[BODY.faces][:, :, 0].mean(axis=1) > 0.0
    assert_allclose(open_shares(BODY, seen(without))["wrist_girth"], 1.0, atol=1e-3)
    one = open_shares(BODY, seen(without | left))
    assert_allclose(one["wrist_girth"], 1.0, atol=0.01)
    assert one["hip_girth"] == one["stature"] == 0.0


def test_of_a_distance_the_matern_process_is_left() -> None:
    """A body 3 cm off the scan all over: twice the root of 1 - rho², rho by the formula of the book."""
    far = Target(TriangleMesh(BODY.vertices + np.array([0.0, 5.0, 0.0]), BODY.faces), 500, 0)
    assert open_shares(BODY, far)["hip_girth"] == 1.0
    wall = np.array([[-9.0, -9.0, -0.03], [9.0, -9.0, -0.03], [0.0, 9.0, -0.03]])
    point = replace(BODY, vertices=np.zeros_like(BODY.vertices))  # where it stands; it is measured as it was
    rho = (1.0 + np.sqrt(3.0) * 0.3) * np.exp(-np.sqrt(3.0) * 0.3)
    shares = open_shares(point, Target(TriangleMesh(wall, np.array([[0, 1, 2]])), 500, 0))
    assert_allclose(shares["waist_girth"], 2.0 * np.sqrt(1.0 - rho**2), rtol=1e-9)


def test_the_spread_is_the_populations_given_what_was_seen() -> None:
    """By the textbook's conditional normal distribution: no wider than without, no narrower than given everything."""
    target = seen(FRONT)
    found, shares = as_people_differ(BODY, SURE, target), open_shares(BODY, target)
    people = population("male")
    k = people.names.index("waist_girth")
    others = [j for j in range(len(people.names)) if j != k]
    cross = people.covariance[k, others]
    least = people.covariance[k, k] - cross @ np.linalg.solve(people.covariance[np.ix_(others, others)], cross)
    share = found["waist_girth"] / shares["waist_girth"]
    assert np.sqrt(least) < share <= 1.02 * np.sqrt(people.covariance[k, k])
    assert shares["waist_girth"] > 0.5
    assert found["shoulder_length"] == SURE["shoulder_length"]
    # half a hip hides the iliac crest, too, which no survey has
    assert found["high_hip_girth"] > 0.01


@pytest.mark.real_data
@pytest.mark.skipif(not BODIES.exists(), reason="the shared data are absent")
def test_the_front_of_a_body_by_others_tells_how_little_it_tells() -> None:
    """Its girths are read from the whole body; of 18 intervals of 95 % at most two may miss."""
    body = read_mesh(BODIES / "mh_male_averageweight.ply")
    config = ScanConfig(sex="male", probes=1500, iterations=10, rounds=2)
    true = measure(fit_scan(body, config)).values
    found = measure(fit_scan(submesh(body, face_normals(body)[:, 2] > 0.1)[0], config))
    girths = [name for name in true if name.endswith("girth")]
    missed = [name for name in girths if abs(found.values[name] - true[name]) > 1.96 * found.sigmas[name]]
    assert len(missed) <= 2, missed
