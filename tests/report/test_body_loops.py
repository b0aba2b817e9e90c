"""The measuring loops drawn on a body."""

import igl
import numpy as np

from vto_pipeline.avatar.template.template import template
from vto_pipeline.geometry.topology import face_normals
from vto_pipeline.report.body_loops import loop_ribbons
from vto_pipeline.report.layers import list_layers


def test_bands_lie_on_the_skin_and_face_outwards() -> None:
    body = template(0.5)
    bands = loop_ribbons(body)
    assert len(bands.vertices) == 2 * sum(len(loop) for loop in body.loops.values())
    distance = np.sqrt(igl.point_mesh_squared_distance(bands.vertices, body.vertices, body.faces.astype(np.int64))[0])
    # 2 mm above the skin at the middle and 2.5 mm to each side of it
    assert 0.0005 < np.median(distance) < 0.003
    assert distance.max() < 0.005
    # of the trunk's bands, every face looks away from the body's axis
    middle, normal = bands.vertices[bands.faces].mean(axis=1), face_normals(bands)
    level = body.vertices[body.loops["waist"], 1].mean()
    waist = (np.abs(middle[:, 1] - level) < 0.001) & (np.abs(middle[:, 0]) < 0.2)
    assert waist.sum() > len(body.loops["waist"])
    assert ((middle * normal)[waist][:, [0, 2]].sum(axis=1) > 0).all()


def test_page_shows_them_with_the_avatar() -> None:
    assert "Where it was measured" in {layer.name for layer in list_layers({"avatar": template(0.5)})}
