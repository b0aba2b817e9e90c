"""The page: one file, no outside references, nothing in it can run that we did not write."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser

import jinja2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image
from report_parts import all_parts, run_record, stage, tube
from scipy.spatial import cKDTree

from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.report.page import build_page
from vto_pipeline.report.scene import script_json

HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\" onload='x' {{ 7*7 }}"
VOID = {"meta", "link", "img", "br", "input", "hr"}


class Elements(HTMLParser):
    """Start tags with their attributes, text by tag, and whether tags are balanced."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text: dict[str, list[str]] = {}
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.setdefault(self.open[-1] if self.open else "", []).append(data)


def scene_of(page: str) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="scene">(.*?)</script>', page, re.S)[1])


@pytest.mark.parametrize(
    "keep", [None, {"garment_surface", "labels"}, {"avatar", "measurements"}, {"fit_report"}, set()]
)
def test_no_outside_reference_and_well_formed(keep: set[str] | None) -> None:
    parts = {k: v for k, v in all_parts().items() if keep is None or k in keep}
    page = build_page(run_record(), parts)
    without_data = re.sub(r'"[A-Za-z0-9+/=]{60,}"', '""', page)  # base64 may hold any two characters in a row
    assert not re.search(r"https?:|//[a-z]|@import|\burl\(", without_data.replace("// ", ""))
    found = Elements(page)
    for tag, attributes in found.tags:
        for name in ("src", "href", "action", "data", "poster", "srcset"):
            assert (attributes.get(name) or "data:,").startswith("data:"), (tag, attributes)
    assert ("canvas" in dict(found.tags)) == bool(keep is None or keep & {"garment_surface", "avatar"})


def test_the_policy_forbids_the_network() -> None:
    policy = next(a["content"] for t, a in Elements(build_page(run_record(), {})).tags if "http-equiv" in a)
    assert policy.startswith("default-src 'none'")


def test_names_from_files_are_text_and_nothing_else() -> None:
    clean, parts = Elements(build_page(run_record(), all_parts())), all_parts()
    parts["fit_report"]["zones"][0] |= {"zone": HOSTILE, "source": HOSTILE, "verdict": HOSTILE}
    parts["fit_report"] |= {"verdict": HOSTILE, "note": HOSTILE}
    parts["audit"] = {HOSTILE: HOSTILE}
    record = run_record(
        stage("drape", metrics={HOSTILE: HOSTILE}, notes=[HOSTILE], warnings=[HOSTILE], left_out=[[HOSTILE, HOSTILE]]),
        stage(HOSTILE, "failed", reason=HOSTILE),
    )
    record |= {"given": {HOSTILE: {"path": HOSTILE}}, "versions": {HOSTILE: HOSTILE}, "wanted": [HOSTILE]}
    page = build_page(record, parts)
    found = Elements(page)
    names = [tag for tag, _ in found.tags]
    assert names.count("script") == [tag for tag, _ in clean.tags].count("script") == 2
    assert "img" not in names
    assert not any(key.startswith("on") for _, attributes in found.tags for key in attributes)
    assert sum(HOSTILE in text for texts in found.text.values() for text in texts) >= 12


def test_json_in_a_script_cannot_end_it() -> None:
    text = script_json({HOSTILE: [HOSTILE]})
    assert "<" not in text
    assert json.loads(text) == {HOSTILE: [HOSTILE]}


def test_packed_positions_come_back() -> None:
    mesh = tube(0.2, 0.3, 1.7)
    packed = scene_of(build_page(run_record(), {"draped": mesh}))["geometries"][0]
    positions, indices = unpack(packed)
    assert_allclose(positions, mesh.vertices, rtol=0, atol=1.4 / 65535, err_msg="half a step of 16 bits, and rounding")
    assert (indices == mesh.faces).all()


def unpack(packed: dict) -> tuple[np.ndarray, np.ndarray]:
    from base64 import b64decode

    grid = np.frombuffer(b64decode(packed["positions"]), "<u2").reshape(-1, 4)[:, :3]
    positions = np.array(packed["low"]) + np.array(packed["size"]) * grid / 65535
    return positions, np.frombuffer(b64decode(packed["indices"]), "<u4").reshape(-1, 3)


def test_large_meshes_are_thinned_and_keep_shape_border_and_size() -> None:
    large = tube(0.2, 0.0, 1.5, around=500, rings=300)  # 299,000 triangles
    page = build_page(run_record(), {"draped": large, "avatar": tube(0.15, 0.0, 1.8, around=500, rings=300)})
    assert len(page) < 8e6
    packed = scene_of(page)["geometries"][0]
    positions, indices = unpack(packed)
    assert 20_000 < len(indices) <= 60_500
    assert_allclose(np.hypot(positions[:, 0], positions[:, 2]), 0.2, rtol=0, atol=1e-3, err_msg="half a mm on a radius")
    border = np.vstack([large.vertices[:500], large.vertices[-500:]])
    missed = cKDTree(positions).query(border)[0].max()
    assert missed < 1.5 / 65535  # a step of 16 bits


def test_layers_and_what_shows_first() -> None:
    layers = scene_of(build_page(run_record(), all_parts()))["layers"]
    assert [layer["name"] for layer in layers if layer["visible"]] == ["Garment", "Body"]
    assert {"Stretch", "Clearance", "Labels"} < {layer["name"] for layer in layers}
    assert next(layer for layer in layers if layer["name"] == "Stretch")["legend"]["unit"] == "%"
    assert "Crossings" not in {layer["name"] for layer in layers}
    marked = scene_of(build_page(run_record(), {**all_parts(), "crossings": tube(0.01, 1.0, 1.01)}))["layers"]
    assert [layer["name"] for layer in marked if layer["visible"]] == ["Garment", "Body", "Crossings"]
    only_scan = scene_of(build_page(run_record(), {"garment_surface": tube(0.2, 0.3, 1.7)}))["layers"]
    assert [layer["visible"] for layer in only_scan] == [True]


def test_a_picture_and_its_places_come_back() -> None:
    from base64 import b64decode
    from io import BytesIO

    mesh = tube(0.2, 0.3, 1.7, around=400, rings=100)  # more triangles than another mesh may keep
    uv = np.column_stack([np.linspace(-0.5, 2.0, len(mesh.vertices)), np.linspace(0, 1, len(mesh.vertices))])
    stripes = np.zeros((300, 4000, 3), np.uint8)
    stripes[:, 2000:, 0] = 200
    skinned = GlbPart("garment", mesh, uv=uv, texture=stripes)
    scene = scene_of(build_page(run_record(), {"render_mesh": [skinned], "avatar": tube(0.1, 0, 1.8)}))
    layer = scene["layers"][0]
    assert len(unpack(scene["geometries"][layer["geometry"]])[1]) == len(mesh.faces)
    grid = np.frombuffer(b64decode(layer["places"]), "<u2").reshape(-1, 2)
    places = np.array(layer["placesLow"]) + np.array(layer["placesSize"]) * grid / 65535
    assert_allclose(places, uv, rtol=0, atol=2.5 / 65535, err_msg="half a step of 16 bits, and rounding")
    kind, _, data = layer["picture"].partition(",")
    assert kind == "data:image/jpeg;base64"
    shown = np.asarray(Image.open(BytesIO(b64decode(data)))).astype(float)
    assert shown.shape == (154, 2048, 3)
    assert_allclose(shown[:, [100, 1900], 0].mean(axis=0), [0, 200], atol=4)  # JPEG
    assert "picture" not in scene["layers"][1]


def test_a_vertex_without_a_face_is_not_packed() -> None:
    mesh = tube(0.2, 0.3, 1.7)
    stray = TriangleMesh(np.vstack([mesh.vertices, [[99.0, 99.0, 99.0]]]), mesh.faces)
    packed = scene_of(build_page(run_record(), {"draped": stray}))["geometries"][0]
    assert max(packed["size"]) < 2


def test_worst_verdict_first() -> None:
    record = run_record(stage("a", warnings=["it is poor"]), stage("b", "failed", reason="it broke"))
    page = build_page(record, all_parts())
    assert page.index("it broke") < page.index("it is poor") < page.index("Chest good")


def test_left_out_and_figures_are_told() -> None:
    page = build_page(run_record(stage("poisson", "left_out", reason="no cloud was given"), stage("drape")), {})
    assert "no cloud was given" in page
    page = build_page(run_record(), {})
    assert "none in fabric" in page
    assert "0.41 mm" in page


def test_templates_are_compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    build_page(run_record(), all_parts())
    monkeypatch.setattr(jinja2.Environment, "compile", lambda *_, **__: pytest.fail("compiled again"))
    build_page(run_record(), all_parts())


def test_same_input_same_page() -> None:
    assert build_page(run_record(), all_parts()) == build_page(run_record(), all_parts())
