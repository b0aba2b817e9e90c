"""Labels and shells against the truth the scan was made from."""

from __future__ import annotations

import numpy as np
import pytest
from dressed_form import SHORT_FORM_ENDS, SKIRT_HEM, SKIRT_TOP, make_skirt_scene
from numpy.testing import assert_allclose

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes
from vto_pipeline.garment.subtraction.subtract import SubtractConfig, extract_garment, label_garment
from vto_pipeline.geometry.remeshing.repair import is_manifold
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import concatenate, face_components, face_normals, submesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


@pytest.fixture(scope="module")
def placed(scene):
    return transform_mesh(scene.scan, scene.mannequin_from_surface)


@pytest.mark.parametrize(("colored", "least"), [(True, 0.985), (False, 0.97)])
def test_nearly_every_vertex_gets_its_true_label(scene, placed, colored, least):
    surface = placed if colored else TriangleMesh(placed.vertices, placed.faces)
    job = Job()
    labels = label_garment(surface, scene.form, SubtractConfig(), job)
    right = (labels.garment == scene.is_shirt)[~scene.on_ledge].mean()
    assert least < right < 1.0
    assert_allclose(job.metrics["noise_mm"], 0.3, rtol=0.15)  # the noise put in, from the bare parts alone
    assert [what for what, _ in job.left_out] == ([] if colored else ["colour evidence"])


def test_confidence_is_less_where_cloth_lies_close(scene, placed):
    plain = TriangleMesh(placed.vertices, placed.faces)
    labels = label_garment(plain, scene.form, SubtractConfig(), Job())
    away = SurfaceDistance(scene.form).signed(placed.vertices).distance
    close, far = (away > 0.0008) & (away < 0.0016), away > 0.005
    assert close.sum() > 20
    assert labels.confidence[close].mean() < 0.95
    assert labels.confidence[far].mean() > 0.99


def test_colour_saves_cloth_that_lies_on_the_form(scene, placed):
    """Cloth pressed to within the noise of the form cannot be told by distance."""
    pressed = scene.is_shirt & (placed.vertices[:, 1] > 0.55) & (placed.vertices[:, 2] > 0.0)
    vertices = placed.vertices.copy()
    noise = np.random.default_rng(0).normal(0.0, 3e-4, vertices[pressed].shape)
    vertices[pressed] = SurfaceDistance(scene.form).nearest(vertices[pressed]).point + noise
    with_color = TriangleMesh(vertices, placed.faces, placed.colors)
    seen = label_garment(with_color, scene.form, SubtractConfig(), Job()).garment[pressed].mean()
    blind = (
        label_garment(TriangleMesh(vertices, placed.faces), scene.form, SubtractConfig(), Job()).garment[pressed].mean()
    )
    assert seen > 0.7
    assert blind < 0.4


def test_cloth_of_nearly_the_forms_colours_is_told_by_distance(scene, placed):
    """Beige on beige in uneven light. Whatever the colours tell, bare form with the form's colours stays bare."""
    rng = np.random.default_rng(1)
    colors = np.where(scene.is_shirt[:, None], [130.0, 106.0, 86.0], [128.0, 104.0, 88.0])
    colors = colors * (1.0 + rng.normal(0.0, 0.15, (len(colors), 1))) + rng.normal(0.0, 2.0, colors.shape)
    surface = TriangleMesh(placed.vertices, placed.faces, np.clip(colors, 0, 255).astype(np.uint8))
    labels = label_garment(surface, scene.form, SubtractConfig(), Job())
    assert labels.garment[~scene.is_shirt & ~scene.on_ledge].mean() < 0.01  # 3 % when too much was taken for cloth
    assert (labels.garment == scene.is_shirt)[~scene.on_ledge].mean() > 0.985


def printed(scene, placed, noise, palest=1.0):
    """A scan of a printed shirt pressed on the chest, 2 mm off; in part of it are the greys that the form has where
    light comes from above.

    Args:
        scene, placed: The form and its scan.
        noise: Of the bare form, into it and out of it [m].
        palest: Of the print where it is pressed on, how much of its colour lamps leave.
    """
    rng = np.random.default_rng(2)
    pressed = scene.is_shirt & (placed.vertices[:, 1] > 0.55) & (placed.vertices[:, 2] > 0.0)
    foot = SurfaceDistance(scene.form).nearest(placed.vertices)
    out = face_normals(scene.form)[foot.face]
    plain = rng.normal(0.0, 1.0, len(out))
    away = np.where(pressed, rng.normal(2e-3, 2e-4, len(out)), plain * np.where(plain < 0.0, *noise))
    moved = pressed | ~scene.is_shirt
    vertices = np.where(moved[:, None], foot.point + away[:, None] * out, placed.vertices)
    flowers = np.array([[150, 145, 132], [205, 190, 170], [160, 175, 190], [190, 150, 140]], float)
    flowers = flowers[np.floor(placed.vertices / 0.012).astype(int) @ [1, 3, 5] % 4]
    ground = [210.0, 195.0, 175.0]
    flowers = np.where(pressed[:, None], ground + palest * (flowers - ground), flowers)
    colors = np.where(scene.is_shirt[:, None], flowers, ground)
    colors = colors * (0.78 + 0.22 * out[:, 1:2]) + rng.normal(0.0, 3.0, colors.shape)
    return TriangleMesh(vertices, placed.faces, np.clip(colors, 0, 255).astype(np.uint8)), pressed


def test_a_print_is_told_from_a_form_in_shade_by_how_its_colours_vary(scene, placed):
    """Stereo finds a print to 0.2 mm, and guesses a plain form to 1.8: cloth 2 mm off it lies within that noise."""
    surface, pressed = printed(scene, placed, (1.8e-3, 1.8e-3))
    job = Job()
    labels = label_garment(surface, scene.form, SubtractConfig(), job)
    assert any("how colours vary tells" in note for note in job.notes)
    assert labels.garment[pressed].mean() > 0.93
    assert labels.garment[~scene.is_shirt & ~scene.on_ledge].mean() < 0.025


def test_a_pale_print_is_told_by_its_distance_where_a_plain_form_is_guessed_inwards(scene, placed):
    """2.5 mm of noise into the form and 0.6 out of it: what shows is cloth that lies 2 mm outside."""
    surface, pressed = printed(scene, placed, (2.5e-3, 0.6e-3), palest=0.5)
    job = Job()
    labels = label_garment(surface, scene.form, SubtractConfig(), job)
    assert job.metrics["noise_mm"] > 2.0  # some lies on ledges
    assert_allclose(job.metrics["noise_outward_mm"], 0.6, rtol=0.25)
    assert labels.garment[pressed].mean() > 0.93
    assert labels.garment[~scene.is_shirt & ~scene.on_ledge].mean() < 0.025


@pytest.mark.parametrize("thick", [0.0015, 0.0025])
def test_bare_arms_that_were_scanned_too_thick_are_the_forms_by_their_colour(scene, placed, thick):
    """They lie as far from the form as tight cloth, many times its noise; the shirt's sleeves are where they were."""
    vertices = placed.vertices.copy()
    arms = ~scene.is_shirt & ~scene.on_ledge & (np.abs(vertices[:, 0]) > 0.2) & (vertices[:, 1] > 0.3)
    assert arms.sum() > 500
    on = SurfaceDistance(scene.form).nearest(vertices[arms])
    vertices[arms] += thick * face_normals(scene.form)[on.face]
    labels = label_garment(TriangleMesh(vertices, placed.faces, placed.colors), scene.form, SubtractConfig(), Job())
    assert labels.garment[arms].mean() < 0.03  # those at the cuffs
    right = (labels.garment == scene.is_shirt)[~scene.on_ledge & ~arms].mean()
    assert right > 0.985


def test_the_board_is_no_garment(scene, placed):
    labels = label_garment(placed, scene.form, SubtractConfig(), Job())
    assert not labels.garment[placed.vertices[:, 1] < -0.001].any()


def test_a_floor_that_a_depth_camera_saw_is_no_garment(scene, placed):
    """It has grown together with the stand, and the camera's noise leaves hardly a triangle of it level."""
    vertices, floor = placed.vertices.copy(), placed.vertices[:, 1] < 0.001
    vertices[floor, 1] += np.random.default_rng(0).normal(0.0, 0.003, floor.sum())
    surface, job = TriangleMesh(vertices, placed.faces, placed.colors), Job()
    upright = np.abs(face_normals(surface)[floor[placed.faces].all(axis=1), 1]) > 0.98
    assert upright.mean() < 0.5
    labels = label_garment(surface, scene.form, SubtractConfig(), job)
    assert labels.garment[floor].mean() < 0.005  # single vertices in the tail of the noise
    assert_allclose(job.metrics["floor_mm"], 0.0, rtol=0, atol=0.3)
    right = (labels.garment == scene.is_shirt)[~scene.on_ledge & ~floor].mean()
    assert right > 0.98


def beside(scene, turned, noise):
    """A rough plate of 20 by 20 cm, 30 cm from the form and as high as its chest; lying, or turned upright."""
    x, z = np.meshgrid(np.arange(41) * 0.005, np.arange(41) * 0.005, indexing="ij")
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    rough = np.random.default_rng(0).normal(0.0, noise, x.shape)
    points = np.stack([x, z, rough] if turned else [x, rough, z], axis=-1).reshape(-1, 3)
    faces = np.vstack([np.column_stack([a, c, b]), np.column_stack([a, d, c])])
    top = scene.form.vertices.max(axis=0)
    place = np.array([top[0] + 0.3, 0.7 * top[1], 0.0])
    return TriangleMesh(points + place, faces, np.full((len(points), 3), 40, np.uint8))


@pytest.mark.parametrize("noise", [0.0005, 0.0035])
@pytest.mark.parametrize("turned", [False, True])
def test_a_level_piece_beside_the_form_is_no_garment_and_one_that_hangs_is(scene, placed, turned, noise):
    """The noise of a depth camera, the second, makes a table's area half as large again."""
    plate = beside(scene, turned, noise)
    both = concatenate([placed, plate])
    job = Job()
    labels = label_garment(both, scene.form, SubtractConfig(), job)
    mine = labels.garment[len(placed.vertices) :]
    assert mine.all() if turned else not mine.any()
    area = "a level piece of 4" if noise < 1e-3 else "a level piece of"  # 20 by 20 cm, and its roughness
    assert any(area in note for note in job.notes) == (not turned)


def test_the_shell_is_one_manifold_piece_on_the_true_shirt(scene, placed):
    labels = label_garment(placed, scene.form, SubtractConfig(), Job())
    job = Job()
    shell = extract_garment(placed, labels, SubtractConfig(), job)
    assert is_manifold(shell)
    assert face_components(shell)[0] == 1
    back = SurfaceDistance(shell).nearest(scene.shirt.vertices).distance
    assert np.median(back) < 6e-4  # noise 0.3 mm, cells of 8 mm
    assert np.percentile(back, 90) < 3e-3  # apart from the four scan holes


def test_a_bare_form_is_refused(scene):
    with pytest.raises(GarmentError, match="stands off"):
        label_garment(scene.form, scene.form, SubtractConfig(thickness_mm=1.0), Job())


@pytest.mark.parametrize("floor", [True, False])
def test_a_long_skirt_on_a_short_form_is_cloth_down_to_its_hem(floor):
    """Half of it hangs below the form; the floor is where the level surface is, not where the form ends."""
    dressed = make_skirt_scene(floor=floor)
    job = Job()
    labels = label_garment(dressed.scan, dressed.form, SubtractConfig(), job)
    height = dressed.scan.vertices[:, 1]
    hanging = dressed.is_shirt & (height < SHORT_FORM_ENDS)
    assert hanging.sum() > 0.4 * dressed.is_shirt.sum()
    assert labels.garment[hanging].mean() > 0.99
    assert (labels.garment == dressed.is_shirt)[~dressed.on_ledge].mean() > 0.97
    if floor:
        assert_allclose(job.metrics["floor_mm"], 0.0, rtol=0, atol=0.5)  # the board's top, in noise of 0.3 mm
        assert labels.garment[height < 0.5 * SKIRT_HEM].mean() < 0.005  # single vertices in the tail of the noise
    shell = extract_garment(dressed.scan, labels, SubtractConfig(), job)
    skirt, openings, _ = close_scan_holes(shell, dressed.form, OpeningsConfig(), job)
    assert_allclose(
        [one.center[1] for one in openings], [SKIRT_TOP, SKIRT_HEM], rtol=0, atol=0.012
    )  # a cell and a half
    assert skirt.vertices[:, 1].min() < SKIRT_HEM + 0.016


def test_tight_cloth_on_a_form_that_was_scanned_roughly_is_cloth(scene, placed):
    """Little of the form is bare, and it was scanned in waves of 2.8 mm. Cloth lies 5 mm off it in the upper half,
    where there is more light: within two deviations of the form lies mostly cloth."""
    on = SurfaceDistance(scene.form).nearest(placed.vertices)
    x, y, z = placed.vertices.T
    tight = y > 0.4
    waves = 2.8e-3 * np.sqrt(2.0) * np.sin(2 * np.pi * (x + 0.7 * y + 0.5 * z) / 0.12)
    vertices = (
        on.point
        + np.where(scene.is_shirt, np.where(tight, 5e-3, 15e-3), waves)[:, None] * (face_normals(scene.form)[on.face])
    )
    light = np.where(scene.is_shirt & tight, 1.3, 1.0)
    colors = np.clip(light[:, None] * placed.colors, 0, 255).astype(np.uint8)
    kept = scene.is_shirt | (y > 0.8)
    surface, source = submesh(TriangleMesh(vertices, placed.faces, colors), kept[placed.faces].all(axis=1))
    labels = label_garment(surface, scene.form, SubtractConfig(), Job())
    shirt = scene.is_shirt[source]
    assert labels.garment[shirt].mean() > 0.95
    assert labels.garment[~shirt].mean() < 0.3
