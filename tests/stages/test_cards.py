"""What notebooks show, read back by the standard library's HTML parser and by Pillow."""

from __future__ import annotations

import subprocess
import sys
from base64 import b64decode
from html.parser import HTMLParser
from io import BytesIO

import numpy as np
import pytest
import trimesh
from PIL import Image

from vto_pipeline import api
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.mesh import Skin, TriangleMesh

TAPE = "unit: cm\nsex: female\nmeasurements: {stature: 170, bust_girth: 93, waist_girth: 78, hip_girth: 101}\n"
HOSTILE = '<script>alert(1)</script> & "quoted" \'n'


class Card(HTMLParser):
    """Tags, rows of cells, and the pictures of a card."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.rows: list[list[str]] = []
        self.texts: list[str] = []
        self.pictures: list[np.ndarray] = []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag == "img":
            kind, _, data = dict(attrs)["src"].partition(",")
            assert kind == "data:image/jpeg;base64"
            self.pictures.append(np.asarray(Image.open(BytesIO(b64decode(data)))))

    def handle_data(self, data):
        if data.strip():
            self.texts.append(data.strip())
            if self.tags[-1] in ("td", "th"):
                self.rows[-1].append(data.strip())

    @property
    def facts(self) -> dict[str, str]:
        return {row[0]: row[1] for row in self.rows if len(row) == 2}


def ball(red: bool = False) -> TriangleMesh:
    shape = trimesh.creation.icosphere(3, 0.25)
    colors = np.full((len(shape.vertices), 3), (220, 0, 0), np.uint8) if red else None
    return TriangleMesh(shape.vertices, shape.faces, colors)


def test_a_mesh_is_shown_with_its_counts_in_centimetres():
    shape = trimesh.creation.icosphere(3, 0.25)
    card = Card(ball(red=True)._repr_html_())
    assert card.facts["vertices"] == f"{len(shape.vertices):,}"
    assert card.facts["triangles"] == f"{len(shape.faces):,}"
    assert card.facts["size"] == "50.0 x 50.0 x 50.0 cm"
    assert float(card.facts["area"].removesuffix(" m²")) == pytest.approx(shape.area, abs=6e-4)  # three digits
    assert card.facts["pieces"] == "1, closed"
    (picture,) = card.pictures
    middle = picture[picture.shape[0] // 2, picture.shape[1] // 2].astype(int)
    assert middle[0] > 100 > 60 > max(middle[1:])  # the ball is red
    assert picture[:5].min() > 240  # and does not reach the rim, where the paper is white


def test_an_unknown_unit_is_said_and_no_area_is():
    unscaled = TriangleMesh(ball().vertices, ball().faces, metric=False)
    facts = Card(unscaled._repr_html_()).facts
    assert facts["size"] == "0.5 x 0.5 x 0.5 of an unknown unit"
    assert "area" not in facts


def test_a_sheet_seen_from_its_edge_is_shown_without_a_picture():
    sheet = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]])
    card = Card(sheet._repr_html_())
    assert (card.pictures, card.facts["pieces"]) == ([], "1, open")


def test_a_garment_says_its_rest_shape_and_a_textured_mesh_its_picture():
    mesh = ball()
    facts = Card(Garment(mesh, RestShape(mesh.vertices, mode="gravity_removed", regraded=True))._repr_html_()).facts
    assert facts["rest shape"] == "gravity removed, made anew in proportion to another body"
    picture = np.zeros((16, 32, 3), np.uint8)
    skinned = TriangleMesh(mesh.vertices, mesh.faces, skin=Skin(np.zeros((len(mesh.faces), 3, 2)), picture))
    assert Card(skinned._repr_html_()).facts["picture"] == "32 x 16 px"


def test_a_run_and_its_avatar_are_shown_whatever_their_names_are(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tape.yaml").write_text(TAPE)
    outcome = api.fit(measurements="tape.yaml", output=tmp_path / HOSTILE.replace("/", "|"))
    outcome.record["stages"][0]["warnings"].append(HOSTILE)
    html = outcome._repr_html_()
    card = Card(html)
    assert "script" not in card.tags
    assert "<script" not in html
    assert any(HOSTILE in text for text in card.texts)
    assert card.facts["folder"] == str(outcome.folder)
    stages = {row[0]: row[1:] for row in card.rows if len(row) == 3}
    assert stages["stage"] == ["ended", "time"]
    assert all(status == "ran" and time.endswith("s") for name, (status, time) in stages.items() if name != "stage")
    assert len(card.pictures) == 1
    facts = Card(outcome.read("avatar")._repr_html_()).facts
    measured = outcome.read("measurements").values
    for name in ("stature", "waist_girth"):
        shown = facts[name.replace("_", " ")].split()
        assert (float(shown[0]), shown[1]) == (pytest.approx(100 * measured[name], abs=0.06), "cm")  # one digit
    outcome.path("avatar").write_bytes(b"no archive")
    torn = Card(outcome._repr_html_())
    assert torn.pictures == []
    assert any("not all of it can be read" in text for text in torn.texts)


def test_without_the_cards_a_value_is_printed_and_nothing_heavy_is_imported():
    code = (
        "import sys; from vto_pipeline.model.mesh import TriangleMesh\n"
        "assert TriangleMesh([[0,0,0],[1,0,0],[0,1,0]], [[0,1,2]])._repr_html_() is None\n"
        "before = set(sys.modules); import vto_pipeline.stages.entry.cards\n"
        "heavy = {'PIL', 'jinja2', 'vto_pipeline.render.pictures', 'vto_pipeline.report.card', "
        "'vto_pipeline.avatar.measure'}\n"
        "print(sorted(heavy & (set(sys.modules) - before)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
