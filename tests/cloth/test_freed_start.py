"""What crosses a body is untangled from it, so that the body begins thick and has little to grow."""

import numpy as np
from cloth_scenes import ball, moved, sheet, tube
from figures import figure
from numpy.testing import assert_allclose
from test_drape import double_vest, pear
from test_rigid_escape import AROUND, bodice_and_sleeve, trunk_and_limb, turns_about_the_limb

from vto_pipeline.cloth.model.coarsening import coarsen
from vto_pipeline.cloth.placement import body_growth
from vto_pipeline.cloth.placement.body_growth import lead_to_body, plan_body_growth
from vto_pipeline.cloth.placement.clear_body import edge_stretches
from vto_pipeline.cloth.placement.collision_free_start import Start, find_collision_free_start
from vto_pipeline.cloth.placement.limbs.openings import pieces_with_limbs
from vto_pipeline.cloth.placement.thinning import LINES, Thinning
from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def limb_girth(growth):
    """The mean distance of the limb's middle from its axis, as the body begins [m]."""
    thick = growth.body.keyframes[-1]
    limb = (thick[:, 1] > 0.15) & (thick[:, 1] < 0.3)
    around = growth.body.keyframes[0][limb][:, [0, 2]]
    return float(np.linalg.norm(around, axis=1).mean())


def test_a_sleeve_that_cuts_into_its_limb_begins_about_a_thick_one():
    body, garment = trunk_and_limb(), moved(bodice_and_sleeve(), 0.03, 0.0, 0.0)
    led, freed = lead_to_body(body, garment, Job()), plan_body_growth(body, garment, Job(), 3e-4)
    assert freed.thinned < led.thinned
    assert limb_girth(freed) > 1.5 * limb_girth(led)
    begin = TriangleMesh(freed.body.keyframes[0], body.faces)
    assert len(intersecting_faces(freed.garment, begin)) == len(self_intersections(freed.garment)) == 0
    assert not SurfaceDistance(begin).inside(freed.garment.vertices).any()
    assert_allclose(abs(turns_about_the_limb(freed.garment.vertices)), 1.0, rtol=0, atol=1e-9)
    assert edge_stretches(freed.garment.vertices, garment.vertices, garment.faces).max() < 1.5


def test_cloth_that_stays_in_a_limb_waits_for_a_thinner_one(monkeypatch):
    """What lies wholly in the body crosses nothing; untangling does not promise to take it out."""

    def as_it_is(positions, *_others):
        return Start(positions, 1, 0, np.zeros(len(positions), bool))

    monkeypatch.setattr(body_growth, "find_collision_free_start", as_it_is)
    body, outer = trunk_and_limb(), moved(bodice_and_sleeve(), 0.02, 0.0, 0.0)
    inner = tube(0.016, 0.04, AROUND, 4, base=0.2)
    faces = np.vstack([outer.faces, inner.faces + np.int32(len(outer.vertices))])
    garment = TriangleMesh(np.vstack([outer.vertices, inner.vertices]), faces)
    growth = Thinning(body).growth(garment)
    assert SurfaceDistance(body).inside(inner.vertices).all()
    assert growth.thinned > 1
    assert body_growth._freed(growth, 3e-4) is growth


def test_what_comes_free_only_beside_the_body_is_not_freed_so():
    """Two coarse layers about a pear: the least move out of the whole of it takes them off it."""
    body = pear()
    garment = coarsen(double_vest(), 108).garment.mesh
    found = plan_body_growth(body, garment, Job(), 3e-4)
    middle = body.vertices[np.abs(body.vertices[:, 1] - garment.vertices[:, 1].mean()) < 0.02].mean(axis=0)
    away = found.garment.vertices - garment.vertices
    assert len(garment.vertices) < 150
    assert np.linalg.norm(away, axis=1).max() < 0.05
    assert np.hypot(*(found.garment.vertices.mean(axis=0) - middle)[[0, 2]]) < 0.02


def test_cloth_beside_an_armpit_is_pierced_by_no_arm():
    """The line that stands for an arm strays out of the body there: a patch across it beside the skin meets no arm."""
    thinning = Thinning(figure(1.0))
    thin, body = thinning.after(LINES), thinning.after(1)
    arm = next(limb for limb, one in enumerate(thinning.limbs.limbs) if one.name == "left arm")
    way = thinning.limbs.ways_in(thin)[arm]
    middles = 0.5 * (way[:-1] + way[1:])
    depth = -SurfaceDistance(body).signed(middles).distance

    def patch(segment):
        """A square of 5 mm across the line."""
        across = np.linalg.svd((way[segment + 1] - way[segment])[None])[2][1:]
        corners = middles[segment] + 2.5e-3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ across
        return TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))

    for segment, is_there in ((int(depth.argmin()), False), (int(depth.argmax()), True)):
        assert any(len(piece.pierced[arm]) for piece in pieces_with_limbs(patch(segment), thinning.limbs, thin))
        assert (thinning.growth_from(patch(segment), 1).pierced > 0) is is_there


def test_coarse_cloth_that_cuts_a_fine_body_is_not_hopeless():
    """One triangle of the cloth meets many of the body's: more pairs than the cloth has triangles."""
    body, cloth = ball(0.05, levels=5), moved(sheet(5, 5, 0.2, 0.2, upright=False), -0.1, 0.04, -0.1)
    pairs = intersecting_faces(cloth, body)
    assert len(pairs) > len(cloth.faces)
    start = find_collision_free_start(cloth.vertices, cloth.faces, cloth.vertices, 3e-4, Job(), body)
    assert (start.crossings, start.crossings_left) == (len(pairs), 0)
    assert len(intersecting_faces(TriangleMesh(start.positions, cloth.faces), body)) == 0
