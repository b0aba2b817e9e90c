"""Garments in layers: nothing crosses, the order is kept, and all is at rest."""

import numpy as np
import pytest
from cloth_scenes import ball, fabric, tube
from ipc_judge import crosses
from numpy.testing import assert_allclose, assert_array_equal

import vto_pipeline.cloth.outfit.layers as layers_module
from vto_pipeline.bench.samples.garments.wardrobe import WARDROBE
from vto_pipeline.bench.samples.garments.wearer import wearer
from vto_pipeline.cloth.judge.order import outside_outer_garment
from vto_pipeline.cloth.outfit.layers import drape_layers
from vto_pipeline.errors import ConfigError, InputError, IntersectingError
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.cloth import Draped
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.outfit import Layer

STAYS = {"place": "as_it_stands"}
QUICK = {**STAYS, "settle_seconds": 4.0, "target_error_mm": 2.0}


def pear(swell=1.0):
    """A closed body: a ball drawn out to 0.6 m, wider below."""
    mesh = ball(1.0, levels=3)
    x, y, z = mesh.vertices.T
    girth = 0.12 * swell * (1.0 - 0.35 * y)
    return TriangleMesh(np.column_stack([girth * x, 0.3 * y, girth * z]), mesh.faces)


def vest(name, radius=0.115, low=0.0, high=0.2, **kinds):
    """A tight tube, stiff enough not to wrinkle within an edge's length: softer ones end in no stable place."""
    mesh = tube(radius, high - low, 40, 10, base=low)
    return Layer(name, Garment(mesh, RestShape(mesh.vertices)), fabric(bending=1e-4, **kinds))


def together(outfit):
    meshes = list(outfit.meshes.values())
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + at for mesh, at in zip(meshes, first[:-1], strict=True)]
    return TriangleMesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))


def clean_and_in_order(outfit, body):
    """Whether all is clean and every garment beneath those that come after it, say judges of their own."""
    audit = outfit.audit
    assert audit["order_kept"] is True
    for kind in ("body", "self", "layer"):
        assert audit[f"{kind}_intersections"] == 0
        assert audit[f"{kind}_intersection_places"] == []
    assert not crosses(together(outfit), body)
    meshes = list(outfit.meshes.values())
    for k, outer in enumerate(meshes):
        for inner in meshes[:k]:
            assert len(outside_outer_garment(inner, outer, body)) == 0


SHIRT, WAISTCOAT = vest("shirt"), vest("waistcoat", 0.112, 0.03, 0.17, stretch=600.0)


@pytest.fixture(scope="module")
def waistcoat_over_shirt():
    """Two vests that begin in one place, and the job."""
    assert len(intersecting_faces(SHIRT.garment.mesh, pear())) > 100
    job = Job()
    return drape_layers([SHIRT, WAISTCOAT], pear(), QUICK, job), job


def test_two_vests_in_one_place_come_to_lie_one_over_the_other(waistcoat_over_shirt):
    outfit, job = waistcoat_over_shirt
    clean_and_in_order(outfit, pear())
    assert outfit.audit["settled"] is True
    assert list(outfit.meshes) == ["shirt", "waistcoat"]
    radius = {
        name: np.hypot(x, z)[abs(y - 0.1) < 0.03].mean()
        for name, (x, y, z) in ((name, mesh.vertices.T) for name, mesh in outfit.meshes.items())
    }
    # they are tight: a thickness lies between them, 0.3 mm, where they do not sag between vertices, by 0.4 mm each
    assert_allclose(radius["waistcoat"] - radius["shirt"], 3e-4, rtol=0, atol=4e-4)
    assert 0.1 < outfit.audit["min_layer_gap_mm"] < 0.4
    each = outfit.audit["layers"]
    assert set(each) == set(job.metrics["put_on_s"]) == {"shirt", "waistcoat"}
    assert outfit.audit["energy_j"] == sum(one["energy_j"] for one in each.values())
    for one in each.values():
        assert one["judged_energy_j"] == pytest.approx(one["energy_j"], rel=1e-9)
    errors = job.metrics["layer_error_mm"]
    assert_allclose(errors["waistcoat"], job.metrics["error_mm"] * np.sqrt(2.0), rtol=1e-12)  # it has half the vertices
    assert job.metrics["error_mm"] < 2.0
    assert job.metrics["seconds"] > job.metrics["together_s"] > 0.0


def test_the_order_is_the_one_asked_for(waistcoat_over_shirt):
    outfit = drape_layers([WAISTCOAT, SHIRT], pear(), QUICK)
    clean_and_in_order(outfit, pear())
    for found, above in ((outfit, 0), (waistcoat_over_shirt[0], 1)):
        shirt, waistcoat = found.meshes["shirt"], found.meshes["waistcoat"]
        order = [shirt, waistcoat] if above == 0 else [waistcoat, shirt]
        assert (
            len(outside_outer_garment(*order, pear())) > 150
        )  # the other way about, most of what is covered is out of order


def test_runs_have_the_same_bits_and_leaving_nothing_out_changes_nothing(waistcoat_over_shirt):
    first = waistcoat_over_shirt[0]
    again = drape_layers([SHIRT, WAISTCOAT], pear(), QUICK)
    whole = drape_layers([SHIRT, WAISTCOAT], pear(), QUICK, Job(force_all=True))
    assert_array_equal(together(again).vertices, together(first).vertices)
    assert again.audit == first.audit
    assert_allclose(together(whole).vertices, together(first).vertices, rtol=0, atol=1e-4)  # the promise: 0.1 mm


def test_both_ride_on_a_body_that_swells():
    thin, fat = pear(0.8), pear(1.1)
    body = MovingBody(np.stack([thin.vertices, fat.vertices]), thin.faces)
    job = Job()
    outfit = drape_layers([vest("shirt"), vest("waistcoat", 0.118, 0.03, 0.17)], body, QUICK, job)
    clean_and_in_order(outfit, fat)
    for name in ("shirt", "waistcoat"):
        assert any(note.startswith(f"{name}: the body under the garment") for note in job.notes)
        assert outfit.audit["layers"][name]["rms_stretch"] > 0.005


def test_one_garment_twice_is_refused():
    with pytest.raises(InputError, match="shirt and jacket are the same garment in the same place"):
        drape_layers([vest("shirt"), vest("jacket")], pear())
    with pytest.raises(InputError, match="no garment"):
        drape_layers([], pear())
    with pytest.raises(InputError, match="two garments are named shirt"):
        drape_layers([vest("shirt"), vest("shirt", 0.12)], pear())


def test_layers_that_end_the_wrong_way_about_are_told_with_places():
    with pytest.raises(
        IntersectingError, match=r"vertices of inner garments lie outside outer ones, near \("
    ) as caught:
        drape_layers([SHIRT, WAISTCOAT], pear(), {**QUICK, "time_budget_s": 0.01})  # no time to put anything on
    partial = caught.value.partial
    beyond = outside_outer_garment(partial["shirt_draped"], partial["waistcoat_draped"], pear())
    assert partial["audit"]["out_of_order_vertices"] == len(beyond) > 100
    assert partial["audit"]["order_kept"] is False


def test_what_went_wrong_while_garments_were_put_on_is_told(monkeypatch):
    """Crossings with the room over what is beneath are no end; they, and each drape's own words, reach the report."""
    asked = []

    def drape(garment, body, fabric, settings, job):
        asked.append(body)
        job.note("a word")
        job.warn("a verdict")
        if len(asked) == 2:
            raise IntersectingError("7 pairs still cross", partial={"draped": garment.mesh})
        return Draped(garment.mesh, np.zeros_like(garment.mesh.vertices), None, (), {})

    monkeypatch.setattr(layers_module, "drape", drape)
    monkeypatch.setattr(layers_module, "wrap_in_surface", lambda body, worn: body)
    monkeypatch.setattr(layers_module._Outfit, "_relax_together", lambda self, worn, seconds: worn)
    job = Job()
    drape_layers([vest("shirt"), vest("waistcoat", 0.13, 0.03, 0.17)], pear(), QUICK, job)
    assert len(asked) == 2
    for name in ("shirt", "waistcoat"):
        assert f"{name}: a word" in job.notes
        assert f"{name}, when put on: a verdict" in job.warnings
    told = [text for text in job.warnings if "7 pairs still cross" in text]
    assert len(told) == 1
    assert told[0].startswith("waistcoat, when put on: over the spare room")


def test_settings_are_checked():
    with pytest.raises(ConfigError, match="skin_mm.*got 0"):
        drape_layers([vest("shirt")], pear(), {"skin_mm": 0})


def test_what_crosses_at_the_end_is_told_with_places_and_every_garment(monkeypatch):
    monkeypatch.setattr(
        layers_module, "wrap_in_surface", lambda body, worn: body
    )  # the second is not put over the first
    rough = {**QUICK, "self_collision": False, "settle_seconds": 0.3}
    with pytest.raises(IntersectingError, match="one garment and another still cross, near") as caught:
        drape_layers([vest("shirt"), vest("waistcoat", 0.112, 0.03, 0.17)], pear(), rough)
    partial = caught.value.partial
    assert {"shirt_draped", "waistcoat_draped", "audit", "trace"} == set(partial)
    pairs = intersecting_faces(partial["shirt_draped"], partial["waistcoat_draped"])
    assert partial["audit"]["layer_intersections"] == len(pairs) > 0
    places = np.array(partial["audit"]["layer_intersection_places"])
    assert_allclose(np.hypot(places[:, 0], places[:, 2]), 0.12, rtol=0, atol=0.02)


def test_a_shirt_hangs_over_trousers():
    body, names = wearer("average").avatar.mesh, {"trousers": "denim", "shirt": "cotton_poplin"}
    layers = [Layer(name, WARDROBE[name](wearer("average"), 50.0), read_fabric(cloth)) for name, cloth in names.items()]
    outfit = drape_layers(layers, body, STAYS)
    clean_and_in_order(outfit, body)
    assert outfit.audit["settled"] is True
    tops = [mesh.vertices[:, 1].max() for mesh in outfit.meshes.values()]
    hem = outfit.meshes["shirt"].vertices[:, 1].min()
    assert hem < tops[0] - 0.05 < tops[1]  # the shirt covers the waistband


def larger(layer, name, factor):
    """The same garment made wider."""
    mesh, rest = layer.garment.mesh, layer.garment.rest
    middle, wider = mesh.vertices.mean(axis=0), np.array([factor, 1.0, factor])
    made = TriangleMesh((mesh.vertices - middle) * wider + middle, mesh.faces)
    return Layer(name, Garment(made, RestShape((rest.positions - middle) * wider + middle)), layer.fabric)


@pytest.mark.slow
@pytest.mark.parametrize("edge_mm", [40.0, 20.0])
@pytest.mark.parametrize("factor", [1.0001, 1.08])
def test_a_shirt_over_a_shirt(edge_mm, factor):
    body = wearer("average").avatar.mesh
    inner = Layer("shirt", WARDROBE["shirt"](wearer("average"), edge_mm), read_fabric("cotton_poplin"))
    outfit = drape_layers([inner, larger(inner, "larger", factor)], body, STAYS)
    clean_and_in_order(outfit, body)
    assert outfit.audit["settled"] is True


@pytest.mark.slow
def test_four_garments():
    body = wearer("average").avatar.mesh
    worn = {"trousers": "denim", "skirt": "wool_suiting", "shirt": "cotton_poplin"}
    layers = [Layer(name, WARDROBE[name](wearer("average"), 30.0), read_fabric(cloth)) for name, cloth in worn.items()]
    layers.append(larger(layers[2], "jacket", 1.06))
    outfit = drape_layers(layers, body, STAYS)
    clean_and_in_order(outfit, body)
    assert outfit.audit["settled"] is True
