"""Models of a fabric against its figures, on regular and on irregular meshes; and what is left out."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet, tube
from numpy.testing import assert_allclose
from scipy.spatial import Delaunay

from vto_pipeline.cloth.constraints.membrane.stretch import stretch
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.model.build import build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.fabric import Fabric, StretchCurve
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

MEMBRANES = ["threads", "green", "springs", "curve"]
CONTINUA = ["threads", "green"]  # that know Poisson's ratio
WOVEN = Fabric("woven", 0.2, 3e-4, 900, 500, 60, 0.2, 0, 0, 0, 0.3)
ISOTROPIC = Fabric("isotropic", 0.2, 3e-4, 600, 600, 600 / 2.6, 0.3, 0, 0, 0, 0.3)
WIDTH, HEIGHT = 0.3, 0.4
SMALL = 1e-4


def irregular(turn=0.0):
    """A rectangle of random triangles, its mesh turned in the plane; the sheet itself lies as ever."""
    rng = np.random.default_rng(2)
    inner = rng.uniform(0.03, 0.97, (150, 2)) * [WIDTH, HEIGHT]
    s = np.linspace(0, 1, 12)
    rim = [np.column_stack([s * WIDTH, 0 * s + y]) for y in (0, HEIGHT)]
    rim += [np.column_stack([0 * s[1:-1] + x, s[1:-1] * HEIGHT]) for x in (0, WIDTH)]
    points = np.vstack([inner, *rim])
    faces = Delaunay(points).simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = np.linalg.det(np.stack([b - a, c - a], axis=1))
    faces = faces[np.abs(area) > 1e-6]
    points = points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return TriangleMesh(np.column_stack([points, np.zeros(len(points))]), faces.astype(np.int32))


MESHES = {"grid": sheet(13, 17, WIDTH, HEIGHT), "irregular": irregular()}


def model_of(mesh, cloth, **settings):
    return build_cloth(mesh, RestShape(mesh.vertices), cloth, materials=Materials(**settings))


def strained(mesh, warp, weft, shear):
    """Positions under a homogeneous strain; warp is y, weft x."""
    move = np.array([[weft, 0.5 * shear, 0.0], [0.5 * shear, warp, 0.0], [0.0, 0.0, 0.0]])
    return mesh.vertices @ (np.eye(3) + move)


def forces(model, x):
    total = np.zeros_like(x)
    return add_forces(x, model.constraints, total), total


def stiffness(mesh, cloth, **settings):
    """K [N/m], shape (3, 3), of small homogeneous strains (warp, weft, shear), from the energy."""
    model = model_of(mesh, cloth, **settings)

    def density(strain):
        return forces(model, strained(mesh, *strain))[0] / (WIDTH * HEIGHT)

    unit = SMALL * np.eye(3)
    alone = np.array([density(u) + density(-u) for u in unit]) / SMALL**2
    found = np.diag(alone)
    for i in range(3):
        for j in range(i):
            both = density(unit[i] + unit[j]) + density(-unit[i] - unit[j])
            found[i, j] = found[j, i] = 0.5 * (both / SMALL**2 - alone[i] - alone[j])
    return found


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("membrane", MEMBRANES)
def test_pulled_along_warp_or_weft_a_sheet_has_its_stiffness(membrane, mesh):
    compliance = np.linalg.inv(stiffness(MESHES[mesh], WOVEN, membrane=membrane))
    regular = membrane != "springs" or mesh == "grid"
    assert_allclose(1.0 / np.diag(compliance)[:2], [900, 500], rtol=1e-3 if regular else 0.03)  # strain of 1e-4
    if regular:
        assert_allclose(1.0 / compliance[2, 2], 60, rtol=1e-3)
    else:  # springs in all directions cannot be as soft in shear as a fabric
        assert 1.3 < 1.0 / compliance[2, 2] / 60 < 2.0


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("membrane", MEMBRANES)
def test_poissons_ratio_is_that_of_the_fabric_where_the_model_knows_it(membrane, mesh):
    found = stiffness(MESHES[mesh], WOVEN, membrane=membrane)
    if membrane == "springs":  # cannot: Cauchy's relation, whatever the fabric says
        assert_allclose(found[0, 1], found[2, 2], rtol=1e-3)
        return
    narrowing = found[0, 1] / found[1, 1]
    assert_allclose(narrowing, 0.0 if membrane == "curve" else 0.2, rtol=0, atol=1e-3)  # strain of 1e-4


@pytest.mark.parametrize("membrane", MEMBRANES)
def test_patch_test(membrane):
    """A homogeneous strain pulls on no inner vertex of any mesh; of a net of springs on an irregular one it does."""
    mesh = MESHES["irregular"]
    model = model_of(mesh, ISOTROPIC, membrane=membrane)
    _, pull = forces(model, strained(mesh, 2e-3, -1e-3, 1e-3))
    rim = np.concatenate(boundary_loops(mesh))
    inner = np.setdiff1d(np.arange(len(pull)), rim)
    share = np.abs(pull[inner]).max() / np.abs(pull[rim]).max()
    if membrane == "springs":
        assert share > 0.1
    else:
        assert share < 1e-10  # rounding


@pytest.mark.parametrize("membrane", MEMBRANES)
def test_an_isotropic_sheet_does_not_mind_how_its_mesh_is_turned(membrane):
    found = [stiffness(irregular(turn), ISOTROPIC, membrane=membrane) for turn in (0.0, 0.4)]
    plane = 600 / (1 - 0.3**2) * np.array([[1, 0.3, 0], [0.3, 1, 0], [0, 0, 0.35]])
    if membrane in CONTINUA:
        for one in found:
            assert_allclose(one, plane, rtol=0, atol=1e-3 * plane[0, 0])  # strain of 1e-4
    else:  # neither has the fabric's Poisson's ratio
        assert np.abs(found[0] - plane).max() > 0.05 * plane[0, 0]


def test_a_grid_of_springs_has_both_diagonals_and_no_second_neighbours():
    mesh = sheet(5, 5, 0.4, 0.4)
    data = model_of(mesh, WOVEN, membrane="springs").constraints[0]
    lengths = np.round(data.rest / 0.1, 6)
    assert (np.unique(lengths) == np.round([1.0, np.sqrt(2.0)], 6)).all()
    assert (lengths > 1.2).sum() == 2 * 16
    assert len(lengths) == 2 * 16 + 2 * 20


def test_bending_springs_cost_a_hinge_s_energy_at_one_radian_and_next_to_nothing_when_small():
    mesh = TriangleMesh(
        np.array([[0, 0, 0], [0, 0.1, 0], [-0.1, 0.05, 0], [0.08, 0.06, 0.0]]), np.array([[0, 1, 2], [1, 0, 3]])
    )
    cloth = fabric(bending=1e-3)

    def cost(bending, angle):
        model = model_of(mesh, cloth, bending=bending)
        x = mesh.vertices.copy()
        x[3] = [0.08 * np.cos(angle), 0.06, 0.08 * np.sin(angle)]
        data = model.constraints[0]
        return add_forces(x, (data,), np.zeros_like(x))

    assert_allclose(cost("springs", 1.0), cost("hinge", 1.0), rtol=1e-12)
    assert cost("springs", 0.05) < 0.01 * cost("hinge", 0.05)
    assert_allclose(cost("springs", 0.02) / cost("springs", 0.01), 16.0, rtol=1e-3)  # the fourth power
    assert_allclose(cost("isometric", 0.02), cost("hinge", 0.02), rtol=1e-4)  # (2 sin θ/2)² against θ²
    assert_allclose(cost("isometric", 2.0) / cost("hinge", 2.0), np.sin(1.0) ** 2, rtol=1e-12)


@pytest.mark.parametrize("bending", ["hinge", "isometric", "springs"])
def test_a_sheet_in_its_plane_does_not_bend(bending):
    mesh = MESHES["irregular"]
    data = model_of(mesh, fabric(bending=1e-3), bending=bending).constraints[0]
    x = mesh.vertices @ np.array([[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]]) + 2.0
    assert add_forces(x, (data,), np.zeros_like(x)) < 1e-20


@pytest.mark.parametrize("bending", ["hinge", "shape_operator", "springs"])
def test_rest_angles_keep_a_crease(bending):
    mesh = tube(0.2, 0.4, 20, 12)
    for keep, check in ((False, lambda e: e > 1e-5), (True, lambda e: e < 1e-20)):
        shape = RestShape(mesh.vertices, rest_angles=keep)
        data = build_cloth(mesh, shape, fabric(bending=1e-3), materials=Materials(bending=bending)).constraints[0]
        assert check(add_forces(mesh.vertices, (data,), np.zeros_like(mesh.vertices)))


def test_isometric_bending_refuses_rest_angles():
    mesh = tube(0.2, 0.4, 20, 12)
    with pytest.raises(ConfigError, match="needs a flat rest shape"):
        build_cloth(
            mesh, RestShape(mesh.vertices, True), fabric(bending=1e-3), materials=Materials(bending="isometric")
        )


def test_a_measured_curve_is_followed():
    strain, tension = (0.0, 0.02, 0.05, 0.1), (0.0, 4.0, 20.0, 80.0)
    knit = Fabric("knit", 0.2, 3e-4, 400, 300, 50, 0.0, 0, 0, 0, 0.3, curve_warp=StretchCurve(strain, tension))
    mesh = MESHES["grid"]
    model = model_of(mesh, knit, membrane="curve")
    top = mesh.vertices[:, 1] == mesh.vertices[:, 1].max()
    for by, force in zip(strain, tension, strict=True):
        _, pull = forces(model, mesh.vertices * [1.0, 1.0 + by, 1.0])
        assert_allclose(-pull[top, 1].sum() / WIDTH, force, rtol=0, atol=1e-9)
    _, pull = forces(model, mesh.vertices * [1.1, 1.0, 1.0])
    right = mesh.vertices[:, 0] == mesh.vertices[:, 0].max()
    assert_allclose(-pull[right, 0].sum() / HEIGHT, 30.0, rtol=1e-9)  # straight where nothing was measured


def test_beyond_its_limit_a_fabric_is_stiff():
    mesh = MESHES["grid"]
    free, limited = (model_of(mesh, WOVEN, strain_limit=limit) for limit in (None, 0.05))
    for by, factor in ((0.04, 1.0), (0.10, 1.0 + 20.0 * 0.05 / 0.10)):
        x = mesh.vertices * [1.0, 1.0 + by, 1.0]
        top = mesh.vertices[:, 1] == mesh.vertices[:, 1].max()
        pulls = [forces(model, x)[1][top, 1].sum() for model in (free, limited)]
        alone = 900 / (1 - 0.2**2 * 500 / 900) * by * WIDTH
        assert_allclose(-pulls[0], alone, rtol=1e-9)
        assert_allclose(-pulls[1], alone + 900 * by * (factor - 1.0) * WIDTH, rtol=1e-9)
    squeezed = mesh.vertices * [1.0, 0.8, 1.0]
    assert_allclose(forces(limited, squeezed)[0], forces(free, squeezed)[0], rtol=1e-12)  # one-sided


def test_energy_of_known_strains():
    mesh = sheet(4, 5, WIDTH, HEIGHT)
    cloth = Fabric("f", 0.2, 3e-4, 900, 500, 100, 0.3, 0, 0, 0, 0.3)
    model = model_of(mesh, cloth)
    area, minor = WIDTH * HEIGHT, 0.3 * 500 / 900
    plane = np.array([[900, 0.3 * 500], [0.3 * 500, 500]]) / (1 - 0.3 * minor)
    for strain in np.array([[0.02, 0.0], [0.0, 0.02], [0.02, -0.01]]):
        x = mesh.vertices * [1 + strain[1], 1 + strain[0], 1]  # warp runs down the sheet
        assert_allclose(forces(model, x)[0], 0.5 * area * strain @ plane @ strain, rtol=1e-12)  # plane stress
        green = strain + 0.5 * strain**2
        stored = forces(model_of(mesh, cloth, membrane="green"), x)[0]
        assert_allclose(stored, 0.5 * area * green @ plane @ green, rtol=1e-12)
    angle = 0.1
    x = mesh.vertices @ np.array([[np.cos(angle), np.sin(angle), 0], [0, 1, 0], [0, 0, 1]])
    assert_allclose(forces(model, x)[0], 0.5 * area * 100 * angle**2, rtol=1e-12)  # threads at 90° less 0.1 rad


@pytest.mark.parametrize("bending", ["hinge", "isometric"])
def test_bending_energy_of_a_cylinder_on_an_aligned_grid(bending):
    mesh = sheet(33, 9, 1.0, 0.25)
    data = model_of(mesh, fabric(bending=2e-3), bending=bending).constraints[0]
    radius = 0.8
    x, y, _ = mesh.vertices.T
    around = np.column_stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)])
    inner = 31 / 32  # the hinges of the two end rows do not turn
    stored = add_forces(around, (data,), np.zeros_like(around))
    assert_allclose(stored, 0.5 * 2e-3 / radius**2 * 0.25 * inner, rtol=2e-3)  # chord against arc


@pytest.mark.parametrize("bending", ["hinge", "isometric"])
def test_bending_energy_of_a_cylinder_on_an_isotropic_mesh(bending):
    radius, height = 0.3, 1.2
    mesh = tube(radius, height, 90, 67)  # nearly equilateral
    data = model_of(mesh, fabric(bending=2e-3), bending=bending).constraints[0]
    whole = 0.5 * 2e-3 / radius**2 * 2 * np.pi * radius * height
    assert 0.8 < add_forces(mesh.vertices, (data,), np.zeros_like(mesh.vertices)) / whole < 1.2


def test_what_has_no_effect_is_left_out_and_said():
    mesh, job = sheet(3, 3, 0.1, 0.1), Job()
    model = build_cloth(mesh, RestShape(mesh.vertices), WOVEN, materials=Materials(hysteresis=True), job=job)
    assert [type(data).__name__ for data in model.constraints] == ["Stretch"]
    assert {what for what, _ in job.left_out} >= {"hinges", "strain limits", "friction of stretch and shear"}


def test_losses_of_a_fabric_become_sliders():
    mesh = sheet(3, 3, 0.1, 0.1)
    cloth = Fabric("f", 0.2, 3e-4, 900, 500, 100, 0.3, 1e-5, 1e-5, 1e-3, 0.3, shear_hysteresis=4.0, damping=0.01)
    model = build_cloth(mesh, RestShape(mesh.vertices), cloth, materials=Materials(hysteresis=True))
    kinds = {type(data).__name__: data for data in model.constraints}
    assert set(kinds) == {"ShapeOperator", "BendFriction", "Stretch", "StrainFriction"}
    assert kinds["Stretch"].damping == 0.01
    assert_allclose(kinds["StrainFriction"].limit, [0.0, 0.0, 2.0])  # to either side


def test_slivers_are_left_out():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0.0]])
    mesh = TriangleMesh(points, [[0, 1, 2], [0, 3, 1]])
    assert len(stretch(mesh.faces, RestShape(points), fabric()).vertices) == 1


def test_an_impossible_fabric_is_refused():
    mesh = sheet(3, 3, 1, 1)
    with pytest.raises(InputError, match="not a stable material"):
        stretch(mesh.faces, RestShape(mesh.vertices), fabric(stretch=100, weft=2000, poisson=0.5))
