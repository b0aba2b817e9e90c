"""Coarse to fine: the same garment in fewer triangles, there and back, and drapes by way of it."""

import numpy as np
import pytest
import trimesh
from cloth_scenes import ball, fabric, moved, sheet, tube
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from test_drape import double_vest, pear, vest

import vto_pipeline.cloth.model.coarsening as coarsening
import vto_pipeline.cloth.rest.multiresolution as levels_module
from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.model.coarsening import coarsen
from vto_pipeline.errors import GarmentError, IntersectingError
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, face_area_vectors
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

SETTINGS = {"settle_seconds": 4.0, "target_error_mm": 1.0}


def area(mesh):
    return np.linalg.norm(face_area_vectors(mesh), axis=1).sum()


def worn():
    """A tube at rest, and turned and drawn out where it is now."""
    laid = tube(0.115, 0.2, 72, 24, base=0.0)
    turn = Rotation.from_rotvec([0.3, -1.0, 0.2]).as_matrix()
    now = laid.vertices * [1.0, 1.1, 1.0] @ turn.T + [1.0, 2.0, 3.0]
    return Garment(TriangleMesh(now, laid.faces), RestShape(laid.vertices, mode="inverse", regraded=True))


def test_the_same_garment_in_a_quarter_of_the_vertices():
    fine = worn()
    coarse = coarsen(fine, len(fine.mesh.vertices) // 4).garment
    laid = TriangleMesh(coarse.rest.positions, coarse.mesh.faces)
    assert 0.8 < 4 * len(laid.vertices) / len(fine.mesh.vertices) < 1.3
    assert area(laid) == pytest.approx(2 * np.pi * 0.115 * 0.2, rel=5e-3)  # of a cylinder; its polygons have less
    assert len(boundary_loops(laid)) == 2
    assert (coarse.rest.mode, coarse.rest.regraded) == ("inverse", True)
    apart = SurfaceDistance(fine.mesh).nearest(coarse.mesh.vertices).distance
    assert apart.max() < 1e-4  # it lies where the fine one is now, chords of the fine one apart
    assert area(coarse.mesh) == pytest.approx(area(fine.mesh), rel=5e-3)


def test_there_and_back():
    fine = worn()
    coarse = coarsen(fine, len(fine.mesh.vertices) // 4)
    back = coarse.prolong(coarse.garment.rest.positions)
    assert_allclose(back, fine.rest.positions, rtol=0, atol=1e-12)  # rounding only
    turn = Rotation.from_rotvec([1.0, -2.0, 0.5]).as_matrix()
    assert_allclose(
        coarse.prolong(coarse.garment.rest.positions @ turn.T + 1.0),
        fine.rest.positions @ turn.T + 1.0,
        rtol=0,
        atol=1e-12,
    )
    assert_allclose(coarse.prolong(coarse.garment.mesh.vertices), fine.mesh.vertices, rtol=0, atol=5e-4)


def test_a_drape_by_way_of_a_coarser_mesh():
    cloth, job = fabric(bending=1e-5), Job()
    found = drape(vest(), pear(), cloth, {**SETTINGS, "coarsen_above": 1000}, job)
    direct = drape(vest(), pear(), cloth, SETTINGS)
    steps = sum(max(row.step for row in found.trace if row.level == level) for level in (0, 1))
    assert job.metrics["body_refits_left_out"] >= steps  # what was left out on both meshes counts
    assert found.audit["settled"] is True
    assert found.audit["body_intersections"] == found.audit["self_intersections"] == 0
    on = [row.level for row in found.trace]
    assert on == sorted(on, reverse=True)
    assert set(on) == {0, 1}
    assert {row.level for row in direct.trace} == {0}
    assert np.all(np.diff([row.seconds for row in found.trace]) > 0)
    assert found.trace[-1].contacts > 100  # it lies on the pear all around
    assert any("first came to rest on" in note for note in job.notes)
    apart = np.linalg.norm(found.mesh.vertices - direct.mesh.vertices, axis=1)
    assert np.median(apart) < 3e-3  # friction remembers the way, within 3 mm of skin and millimetres of slip
    again = drape(vest(), pear(), cloth, {**SETTINGS, "coarsen_above": 1000})
    assert (again.mesh.vertices == found.mesh.vertices).all()


def test_a_small_garment_needs_none():
    job = Job()
    drape(vest(), pear(), fabric(), {"settle_seconds": 0.1}, job)
    reasons = dict(job.left_out)
    assert "1728 vertices; it pays off above 4000" in reasons["coming to rest on a coarser mesh first"]


def test_a_garment_that_cannot_be_made_coarser_is_draped_as_it_is(monkeypatch):
    def refuse(*_):
        raise GarmentError("remeshing broke the surface")

    monkeypatch.setattr(coarsening, "coarsen", refuse)
    job = Job()
    found = drape(vest(), pear(), fabric(), {"settle_seconds": 0.1, "coarsen_above": 1000}, job)
    assert {row.level for row in found.trace} == {0}
    assert "remeshing broke the surface" in dict(job.left_out)["coming to rest on a coarser mesh first"]


@pytest.mark.parametrize("garment", [vest(), pytest.param(double_vest(), marks=pytest.mark.slow)])
def test_what_edges_cut_on_a_coarse_mesh_is_cleared_there_or_on_a_finer_one(garment):
    """How many meshes are given up is a matter of rounding."""
    job = Job()
    found = drape(
        garment, pear(), fabric(bending=1e-5), {**SETTINGS, "target_error_mm": 4.0, "coarsen_above": 100}, job
    )
    given_up = [why for what, why in job.left_out if what.endswith(" vertices first")]
    assert all("too coarse" in why for why in given_up)
    assert any("of 1 to 30" in why for _, why in job.left_out)  # mm: no mesh is so coarse that it cannot
    assert found.audit["settled"] is True
    assert found.audit["body_intersections"] == found.audit["self_intersections"] == 0


def test_what_a_coarse_mesh_leaves_in_the_body_begins_on_a_finer_one(monkeypatch):
    resolve = levels_module.Phases.resolve_crossings

    def in_part(self, state, body=None):
        state = resolve(self, state, body)
        self.crossings_left += body is not None and len(state.positions) < len(vest().vertices)
        return state

    cleared, settle = [], levels_module.Phases.settle_and_clear

    def watched(self, *given, clears=True):
        cleared.append(clears)
        return settle(self, *given, clears=clears)

    settings, job = {"settle_seconds": 0.1}, Job()
    monkeypatch.setattr(levels_module.Phases, "settle_and_clear", watched)
    alone = drape(vest(), pear(), fabric(), settings)
    drape(vest(), pear(), fabric(), {**settings, "coarsen_above": 1000})
    assert cleared == [True, False, True]  # alone; what is clear of the body on a coarse mesh; and then alone
    monkeypatch.setattr(levels_module.Phases, "resolve_crossings", in_part)
    monkeypatch.setattr(
        levels_module,
        "intersecting_faces",
        lambda cloth, _: np.zeros((7 * (len(cloth.vertices) < len(vest().vertices)), 2), np.int32),
    )
    found = drape(vest(), pear(), fabric(), {**settings, "coarsen_above": 1000}, job)
    assert cleared[3:] == [True, True]
    assert "too coarse: 7 pairs of triangles still intersect" in [why for _, why in job.left_out]
    assert (found.mesh.vertices == alone.mesh.vertices).all()


def jam_on_coarse_meshes(monkeypatch):
    """Let every mesh with fewer vertices than a vest's end jammed."""
    reached = levels_module.Phases.settle_and_clear

    def jam(self, state, *rest, **how):
        found = reached(self, state, *rest, **how)
        found.jammed = len(state.positions) < len(vest().vertices)
        return found

    monkeypatch.setattr(levels_module.Phases, "settle_and_clear", jam)


def test_what_is_too_small_and_jams_on_a_coarse_mesh_is_refused_there(monkeypatch):
    jam_on_coarse_meshes(monkeypatch)
    put_on = vest()
    small = Garment(put_on, RestShape(0.8 * put_on.vertices))
    settings = {"settle_seconds": 0.1, "coarsen_above": 1000, "place": "as_it_stands"}
    with pytest.raises(
        IntersectingError, match=r"needs the garment 25% larger, and on a coarser mesh .*jammed"
    ) as info:
        drape(small, pear(), fabric(), settings)
    assert (info.value.partial["draped"].vertices == put_on.vertices).all()


def test_what_is_worn_stretched_and_jams_on_a_coarse_mesh_is_not_refused(monkeypatch):
    """Snug cloth is stretched where it was scanned; none was enlarged to get the body into it."""
    jam_on_coarse_meshes(monkeypatch)
    snug, job = Garment(vest(), RestShape(vest().vertices / 1.1)), Job()
    drape(snug, pear(), fabric(), {"settle_seconds": 0.1, "coarsen_above": 1000, "place": "as_it_stands"}, job)
    assert any("jammed" in why for _, why in job.left_out)


def test_where_a_coarse_mesh_jams_the_next_starts_where_the_garment_was_given(monkeypatch):
    job = Job()
    settings = {"settle_seconds": 0.1}
    alone = drape(vest(), pear(), fabric(), settings)
    jam_on_coarse_meshes(monkeypatch)
    found = drape(vest(), pear(), fabric(), {**settings, "coarsen_above": 1000}, job)
    assert any(what.startswith("coming to rest on ") and "jammed" in why for what, why in job.left_out)
    assert (found.mesh.vertices == alone.mesh.vertices).all()


def test_how_it_was_put_on_is_told_though_only_a_coarse_mesh_was(monkeypatch):
    grow = levels_module.Phases.grow_body

    def led(self, state, body):
        self._job.warn("it was moved by 453 mm")
        return grow(self, state, body)

    monkeypatch.setattr(levels_module.Phases, "grow_body", led)
    job = Job()
    drape(vest(), pear(), fabric(), {"settle_seconds": 0.1, "coarsen_above": 1000}, job)
    assert job.warnings.count("it was moved by 453 mm") == 1
    assert not any("453 mm" in note for note in job.notes)


@pytest.mark.parametrize(("size", "coarse"), [(0.5, False), (0.4, True)])
def test_a_thorn_that_comes_between_the_vertices_stays_out_of_the_cloth(size, coarse):
    """It is thinner than triangles, which alone would lie on the ball with the thorn through them."""
    round_one, cone = ball(0.15, levels=4), trimesh.creation.cone(0.006, 0.05, sections=12)
    tip = cone.vertices[:, [1, 2, 0]] + [0.004, 0.14, 0.003]
    body = TriangleMesh(
        np.vstack([round_one.vertices, tip]),
        np.vstack([round_one.faces, cone.faces + len(round_one.vertices)]).astype(np.int32),
    )
    top, job = tip[:, 1].max(), Job()
    cloth = moved(sheet(33, 33, size, size, upright=False), 0.001 - size / 2, top + 0.005, 0.002 - size / 2)
    settings = {"settle_seconds": 1.0, "coarsen_above": 1000, "place": "as_it_stands"}
    found = drape(cloth, body, fabric(bending=1e-5), settings, job)
    between = [note for note in job.notes if "parts of the body came between" in note]
    assert len(between) == 1
    assert ("1089 vertices" in between[0]) is not coarse
    assert found.audit["body_intersections"] == found.audit["self_intersections"] == 0
    assert found.mesh.vertices[:, 1].max() > top - 1e-3  # it hangs over the tip


@pytest.mark.parametrize(("budget", "times"), [(None, 1), (1e-3, 0)])
def test_a_mesh_is_gone_through_once_more_while_there_is_time(budget, times, monkeypatch):
    monkeypatch.setattr(levels_module, "intersecting_faces", lambda *_: np.zeros((7, 2), np.int32))
    job = Job()
    drape(vest(), pear(), fabric(), {"settle_seconds": 0.1, "time_budget_s": budget}, job)
    assert sum("parts of the body came between" in note for note in job.notes) == times


@pytest.mark.parametrize(("above", "meshes"), [(100_000, 1), (1000, 2)])
def test_what_is_gone_through_once_more_is_not_put_on_again(above, meshes, monkeypatch):
    """Planning how the body grows, and letting it, took longer than all the rest."""
    grow, grown = levels_module.Phases.grow_body, []

    def counted(self, state, body):
        self._job.warn("it was put on")
        grown.append(len(state.positions))
        return grow(self, state, body)

    monkeypatch.setattr(levels_module.Phases, "grow_body", counted)
    monkeypatch.setattr(levels_module, "intersecting_faces", lambda *_: np.zeros((7, 2), np.int32))
    monkeypatch.setattr(levels_module, "freed_of_body", lambda *_: None)
    job = Job()
    drape(vest(), pear(), fabric(), {"settle_seconds": 0.1, "coarsen_above": above}, job)
    assert len(grown) == meshes
    assert sum("parts of the body came between" in note for note in job.notes) == meshes
    assert job.warnings.count("it was put on") == 1
