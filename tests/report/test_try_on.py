"""Sliders between drapes: shapes and errors against closed forms, and the page in a browser."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image
from report_parts import tube

from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.report.layers import PageLayer
from vto_pipeline.report.try_on.between import deepest_inside, left_out, midway
from vto_pipeline.report.try_on.page import Choice, Fitted, Slider, build_try_on_page


def test_what_is_multilinear_is_not_missed():
    first, second = np.meshgrid([1.0, 2.0, 5.0], [0.0, 1.0, 1.5, 4.0], indexing="ij")
    shape = np.random.default_rng(0).normal(size=(4, 7, 3))
    terms = np.stack([np.ones_like(first), first, second, first * second])
    places = np.einsum("tij,tvd->ijvd", terms, shape)
    found = left_out(places, [(1.0, 2.0, 5.0), (0.0, 1.0, 1.5, 4.0)])
    assert found.shape == (4 + 2 * 3, 7)  # one inner value beside four, two beside three
    assert_allclose(found, 0.0, atol=1e-12)


def test_a_parabola_is_missed_by_its_chord():
    values = (0.0, 1.0, 3.0)
    places = np.zeros((3, 2, 3))
    places[:, 1, 0] = np.square(values)
    assert_allclose(left_out(places, [values]), [[0.0, 2.0]])  # the chord of x² from 0 to 3 at 1: 3 - 1
    assert left_out(places[:2], [values[:2]]).shape == (0, 2)


def test_midway_is_the_mean_of_the_corners():
    places = np.arange(2 * 3 * 1 * 3, dtype=float).reshape(2, 3, 1, 3)
    assert_allclose(list(midway(places)), [places[:, k : k + 2].mean(axis=(0, 1)) for k in range(2)])


def test_cloth_that_turns_half_round_passes_through_the_axis():
    body, worn = tube(0.1, 0.0, 1.0), tube(0.12, 0.3, 0.7)
    body = TriangleMesh(body.vertices, body.faces)
    turned = worn.vertices * [-1.0, 1.0, -1.0]
    still = np.stack([body.vertices, body.vertices])
    assert deepest_inside(np.stack([worn.vertices, worn.vertices]), still, body.faces) == 0.0
    deep = deepest_inside(np.stack([worn.vertices, turned]), still, body.faces)
    assert deep == pytest.approx(0.1, rel=2e-3)  # the apothem of a polygon of 96 corners


def layer(name: str, group: str, radii: list[float], low: float, high: float) -> PageLayer:
    meshes = [tube(radius, low, high, 24, 8) for radius in radii]
    return PageLayer(name, meshes[0], group, "#6a8fc0", frames=np.stack([mesh.vertices for mesh in meshes]))


def page():
    sliders = [Slider("chest girth", "cm", (80.0, 90.0, 110.0)), Slider("stature", "cm", (160.0, 170.0))]
    nodes = [(chest, stature) for chest in sliders[0].values for stature in sliders[1].values]
    radii = [0.002 * chest for chest, _ in nodes]
    fits = tuple({"verdict": f"fits <{c}, {s}>", "ease_cm": {"chest": c - 100, "hem": s - 100}} for c, s in nodes)
    one = Fitted(
        (layer("Garment", "garment", [r + 0.03 for r in radii], 0.8, 1.4),),
        layer("Body", "body", radii, 0.0, 1.7),
        fits,
    )
    return build_try_on_page("Tubes", sliders, [Choice("fabric", ("denim", "silk"))], [one, one])


def test_the_page_tells_its_error():
    made = page()
    assert made.left_out is not None
    assert_allclose(list(made.left_out.values()), 0.0, atol=1e-12)  # radii are linear in the girth
    assert made.inside == 0.0
    assert "12 drapes" in made.html
    assert "no cloth is inside" in made.html
    assert "<80.0" not in made.html.replace("fits \\u003c80.0", "")  # a verdict cannot end its script


def test_sliders_are_multilinear_in_a_browser(tmp_path: Path):
    browser = pytest.importorskip("test_page_in_browser")
    if browser.BROWSER is None:
        pytest.skip("no Chromium on this machine")
    (tmp_path / "page.html").write_text(page().html, encoding="utf-8")
    address = (tmp_path / "page.html").as_uri()
    flags = (*browser.FLAGS, *browser.SOFTWARE_WEBGL, f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom")
    wide = {}
    for at in (80, 90, 110, 100):
        picture = tmp_path / "page.png"
        command = [
            str(browser.BROWSER),
            *flags[:-1],
            f"--screenshot={picture}",
            "--window-size=900,900",
            f"{address}#{at},170",
        ]
        subprocess.run(command, capture_output=True, timeout=120, check=True)
        with Image.open(picture) as image:
            red, _, blue = np.moveaxis(np.asarray(image.convert("RGB")).astype(int), 2, 0)[:3]
        cloth = (blue > 1.3 * red) & (blue > 90)
        cloth[:450] = False  # the slider
        wide[at] = np.ptp(np.nonzero(cloth)[1])
    assert wide[110] - wide[80] > 30
    assert_allclose([wide[90], wide[100]], np.interp([90, 100], [80, 110], [wide[80], wide[110]]), atol=2.0)  # pixels

    zones = {}
    for at in ("#90,170", "#95,162.5", "#999,0"):
        command = [str(browser.BROWSER), *flags, address + at]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
        said = [line for line in done.stderr.splitlines() if "CONSOLE" in line and "GL Driver" not in line]
        assert said == []
        state = re.search(r'<p id="state"[^>]*>([^<]*)<', done.stdout)[1]
        cells = re.findall(r'<td>(\w+)</td><td class="n">([^<]*)</td>', done.stdout)
        zones[at] = (state, {name: float(value.replace("−", "-")) for name, value in cells})
        assert float(re.search(r'data-ms="([\d.]+)"', done.stdout)[1]) < 1000.0
    assert zones["#90,170"] == ("Draped: fits &lt;90.0, 170.0&gt;", {"chest": -10.0, "hem": 70.0})
    assert zones["#95,162.5"] == ("Nearest drape: fits &lt;90.0, 160.0&gt;", {"chest": -5.0, "hem": 62.5})
    assert zones["#999,0"] == ("Draped: fits &lt;110.0, 160.0&gt;", {"chest": 10.0, "hem": 60.0})
