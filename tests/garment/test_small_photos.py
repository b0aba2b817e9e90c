"""What of a photo is looked at: all that shows what is asked about, where the camera saw it."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from PIL import Image

from vto_pipeline.garment.align import PosedPhotos
from vto_pipeline.garment.photographed.sightings import of_small_photos
from vto_pipeline.geometry.seen.depth_picture import depth_picture
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.mesh import TriangleMesh

CAMERA = Intrinsics(width=320, height=240, fx=300.0, fy=300.0, cx=159.5, cy=119.5)


def tetrahedron(middle, size):
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]], dtype=np.int32)
    return TriangleMesh(np.asarray(middle) + size * corners, faces)


def asked(folder, *things):
    """What is handed over of a photo of noise, taken from the origin, and the photo."""
    picture = np.random.default_rng(0).integers(0, 256, (CAMERA.height, CAMERA.width, 3), dtype=np.uint8)
    Image.fromarray(picture).save(folder / "one.png")
    cameras = CameraSet(("one.png",), (CAMERA,), np.eye(4)[None])
    photos = PosedPhotos((folder / "one.png",), cameras)
    ((part, camera, pose),) = of_small_photos(photos, things, lambda *handed: handed)
    assert_array_equal(pose, np.eye(4))
    return part, camera, picture


@pytest.mark.parametrize(
    "middle", [(0.1013, -0.0507, 2.0), (-0.9013, 0.6077, 2.0)]
)  # in the picture, and across its corner
def test_a_part_of_the_photo_shows_the_thing_where_the_whole_does(tmp_path, middle):
    thing, other = tetrahedron(middle, 0.1), tetrahedron((0.15, 0.0, 2.2), 0.05)
    part, camera, picture = asked(tmp_path, thing, other)
    assert part.shape == (camera.height, camera.width, 3)
    assert part.size < 0.5 * picture.size
    for one in (thing, other):
        seen, whole = (np.isfinite(depth_picture(one, lens, np.eye(4))) for lens in (camera, CAMERA))
        assert whole.any()
        assert_array_equal(part[seen], picture[whole])  # in the same order: rows, then columns


def test_what_reaches_behind_the_camera_is_looked_for_in_the_whole_photo(tmp_path):
    corners = np.array([[0.0, 0.0, 1.0], [0.01, 0.0, 1.0], [0.5, 0.3, -1.0]])  # from the middle to the right
    part, camera, picture = asked(tmp_path, TriangleMesh(corners, np.array([[0, 1, 2]], dtype=np.int32)))
    assert_array_equal(part, picture)
    assert camera == CAMERA


def test_what_the_photo_does_not_show_is_looked_for_in_the_whole_photo(tmp_path):
    part, camera, picture = asked(tmp_path, tetrahedron((5.0, 0.0, 2.0), 0.1))
    assert_array_equal(part, picture)
    assert camera == CAMERA
