"""Texture coordinates that are panels: found where they are, refused where they are charts for painting."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cloth_scenes import sheet
from numpy.testing import assert_allclose
from slow_cases import every

from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.judge.residual import ElasticEnergies
from vto_pipeline.cloth.judge.strain import gradients, principal_strains, rest_triangles
from vto_pipeline.cloth.model.build import build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.rest_shape.edge_length_embedding import lengths_in_space
from vto_pipeline.cloth.rest_shape.from_hanging import RestShapeConfig, rest_shape
from vto_pipeline.cloth.rest_shape.from_panels import find_panels, panels_on
from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.garment.simulation_mesh import SimulationMeshConfig, remesh_for_simulation
from vto_pipeline.geometry.remeshing.repair import RepairConfig, repair
from vto_pipeline.geometry.topology import edges
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

DATA = Path(__file__).parents[3] / "shared" / "data" / "garments"
WOVEN = Fabric("woven", 0.2, 3e-4, 900, 500, 100, 0.3, 1e-4, 5e-5, 0, 0.3)


def sides(corners):
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def rolled(columns=33, rows=21, width=0.6, height=0.4):
    """A sheet rolled up by half a turn, and its corners in the plane, shape (F, 3, 2)."""
    flat = sheet(columns, rows, width, height)
    turn = np.pi * flat.vertices[:, 0] / width
    x = np.column_stack([width / np.pi * np.cos(turn), flat.vertices[:, 1], width / np.pi * np.sin(turn)])
    return TriangleMesh(x, flat.faces), flat.vertices[flat.faces][:, :, :2]


def cut_in_two(mesh, laid, shift=1.0):
    """The same panels, the right half apart from the left."""
    right = laid[:, :, 0].mean(axis=1) > 0.3
    return np.where(right[:, None, None], laid + shift, laid)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("cm", 100.0), ("mm", 1000.0)])
@pytest.mark.parametrize("worn", [0.97, 1.0, 1.06])
def test_panels_are_found_in_their_unit_and_told(unit, factor, worn):
    mesh, laid = rolled()
    given = TriangleMesh(worn * mesh.vertices, mesh.faces, texture=factor * cut_in_two(mesh, laid))
    found = find_panels(given)
    assert (found.unit, found.pieces, found.doubt) == (unit, 2, "")
    job = Job()
    rest = rest_shape(given, RestShapeConfig(), job, given=given)
    assert rest.mode == "panels"
    # chords of the roll are shorter than its arcs by (pi / 32)^2 / 24
    assert_allclose(sides(rest.corners(mesh.faces)), sides(laid), rtol=1e-9)
    assert_allclose(job.metrics["given_stretch_median_share"], worn - 1.0, rtol=0, atol=1e-3)
    assert "2 pieces" in job.notes[0]
    assert f"in {unit}" in job.notes[0]


def unit_square(mesh, laid):
    return laid / np.ptp(laid[..., 0])


def stretched_chart(mesh, laid):
    return laid * (1.4, 0.75)


def mirrored_halves(mesh, laid):
    return np.abs(laid - (0.3, 0.0))


@pytest.mark.parametrize(
    ("chart", "why"),
    [(unit_square, "times as long"), (stretched_chart, "stretched by no more"), (mirrored_halves, "shares its place")],
)
def test_charts_for_painting_are_refused_unless_asked_for(chart, why):
    mesh, laid = rolled()
    given = TriangleMesh(mesh.vertices, mesh.faces, texture=chart(mesh, laid))
    assert why in find_panels(given).doubt
    job = Job()
    rest = rest_shape(mesh, RestShapeConfig(), job, given=given)
    assert (rest.mode, rest.panels) == ("as_scanned", None)
    assert why in job.notes[0]
    asked = rest_shape(mesh, RestShapeConfig(mode="panels"), told := Job(), given=given)
    assert asked.mode == "panels"
    assert why in told.warnings[0]
    if chart is unit_square:
        assert_allclose(sides(asked.corners(mesh.faces)), sides(laid), rtol=2e-3)


def test_panels_that_are_not_there_cannot_be_taken():
    mesh, _ = rolled()
    with pytest.raises(ConfigError, match="there are none"):
        rest_shape(mesh, RestShapeConfig(mode="panels"), Job(), given=mesh)
    assert rest_shape(mesh, RestShapeConfig(), Job(), given=mesh).mode == "as_scanned"
    with pytest.raises(InputError, match="panels of 2 faces"):
        RestShape(mesh.vertices, panels=np.zeros((2, 3, 2))).corners(mesh.faces)


MODELS = [
    *({"membrane": name} for name in ("threads", "green", "springs", "curve")),
    *({"bending": name} for name in ("shape_operator", "isometric", "springs")),
    {"strain_limit": 0.01, "hysteresis": True, "yield_curvature": 20.0},
]


@pytest.mark.parametrize("materials", MODELS, ids=lambda one: "-".join(map(str, one.values())))
def test_cloth_of_panels_is_the_cloth_that_was_cut(materials):
    """Forces are those of the flat sheet as a rest shape, wherever its halves lie in the plane."""
    mesh, laid = rolled(13, 9)
    flat = np.zeros_like(mesh.vertices)
    flat[mesh.faces.ravel(), :2] = laid.reshape(-1, 2)
    x = mesh.vertices * np.array([1.02, 0.99, 1.01])
    forces = []
    for rest in (RestShape(flat), RestShape(mesh.vertices, panels=cut_in_two(mesh, laid))):
        model = build_cloth(mesh, rest, replace(WOVEN, stretch_hysteresis=1.0), materials=Materials(**materials))
        found = np.zeros_like(x)
        add_forces(x, model.constraints, found)
        forces.append(np.column_stack([found, model.mass]))
    assert np.abs(forces[0]).max() > 1e-3
    assert_allclose(forces[1], forces[0], rtol=1e-9, atol=1e-9 * np.abs(forces[0]).max())  # sums in another order


def test_the_judge_knows_panels():
    mesh, laid = rolled(13, 9)
    rest = RestShape(mesh.vertices, panels=cut_in_two(mesh, laid))
    x = mesh.vertices * np.array([1.02, 0.99, 1.01])
    model = build_cloth(mesh, rest, WOVEN)
    assert_allclose(ElasticEnergies(mesh, rest, WOVEN).energy(x), elastic_energy(model, x), rtol=1e-9)
    strain = principal_strains(gradients(x, mesh.faces, rest_triangles(rest.corners(mesh.faces))))
    assert_allclose(strain.max(), 0.0195, rtol=0, atol=3e-3)  # 2 % across, less what the chords are short of the arcs


def test_a_gathered_seam_bends_as_the_judge_says_and_as_its_mirror_image():
    """One panel is half as long again as the other along their seam; nothing may depend on the end that is first."""
    mesh, laid = rolled(13, 9)
    wide = laid[:, :, 0].mean(axis=1) > 0.3
    gathered = np.where(wide[:, None, None], laid * np.array([1.0, 1.5]), laid)
    stiff = replace(WOVEN, bending_warp=200.0, bending_weft=100.0)
    aside = np.array([-1.0, 1.0, 1.0])
    mirrored = TriangleMesh(mesh.vertices * aside, mesh.faces[:, ::-1])
    energies = []
    for one, panels in ((mesh, gathered), (mirrored, gathered[:, ::-1] * aside[:2])):
        rest = RestShape(one.vertices, panels=panels)
        energies.append(elastic_energy(build_cloth(one, rest, stiff), one.vertices))
        assert_allclose(ElasticEnergies(one, rest, stiff).energy(one.vertices), energies[-1], rtol=1e-9)
    assert_allclose(energies[1], energies[0], rtol=1e-9)


def test_positions_with_the_lengths_of_the_panels():
    mesh, laid = rolled()
    rest = RestShape(mesh.vertices, panels=cut_in_two(mesh, 1.03 * laid))
    found = lengths_in_space(rest, mesh)
    ends = edges(mesh)
    now, was = (np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1) for x in (found, mesh.vertices))
    assert_allclose(now / was, 1.03, rtol=2e-3)  # chords and arcs
    assert lengths_in_space(RestShape(mesh.vertices), mesh) is not None


GARMENTS = sorted(DATA.glob("berkeley/*/*-iso.obj"))


@pytest.mark.real_data
@pytest.mark.skipif(not GARMENTS, reason="the garments are not part of the repository")
@pytest.mark.parametrize("path", every(4, GARMENTS), ids=lambda path: path.stem)
def test_real_panels(path):
    """The library has the panels as a second file; the worn mesh tells them by its texture coordinates alone."""
    given = read_mesh(path)
    panels = find_panels(given)
    assert panels.doubt == ""
    cut = read_mesh(path.with_name(f"{path.stem}-m.obj"), unit="m")
    worn = repair(given, RepairConfig(), Job())
    rest = rest_shape(worn, RestShapeConfig(), Job(), given=given)
    assert_allclose(sides(rest.corners(worn.faces)), sides(cut.vertices[cut.faces]), rtol=1e-9)
    coarse = SimulationMeshConfig(edge_mm=20.0)
    remeshed = remesh_for_simulation(worn, coarse, Job())
    laid = panels_on(remeshed, given, panels, Job())
    cloth = [0.5 * np.abs(np.linalg.det(x[:, 1:] - x[:, :1])).sum() for x in (laid, panels.laid)]
    assert_allclose(cloth[0], cloth[1], rtol=0.012)  # robe and shirt lie in several layers; in space 1 to 7 % are lost


@pytest.mark.real_data
@pytest.mark.skipif(not GARMENTS, reason="the garments are not part of the repository")
@pytest.mark.parametrize("path", sorted(DATA.glob("makehuman/*.obj")), ids=lambda path: path.stem)
def test_real_charts_are_not_panels(path):
    assert "times as long" in find_panels(read_mesh(path)).doubt
