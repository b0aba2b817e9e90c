"""SVG patterns: drawings of known size and place, what in them is no panel, and ours back whole."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import svgelements
from hypothesis import given, settings
from pattern_shapes import half_disc, panels, rich_pattern

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.patterns.loops import edges_area, edges_length, edges_points
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.io.patterns.record import pattern_of, record_of
from vto_pipeline.io.patterns.svg.read import parse_svg
from vto_pipeline.io.patterns.write import write_pattern
from vto_pipeline.model.job import Job
from vto_pipeline.model.pattern import Pattern

BEANIES = Path(__file__).parents[3] / "shared/data/patterns/jarmo_svg_cc0/beanie"
SPACE = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'


def read(tmp_path, body, head='width="1000mm" height="1000mm" viewBox="0 0 1000 1000"', job=None, **options):
    path = tmp_path / "d.svg"
    path.write_text(f"<svg {SPACE} {head}>{body}</svg>")
    return read_pattern(path, job=job, **options)


@pytest.mark.parametrize(
    ("head", "side_m", "options"),
    [
        ('width="1000mm" height="1000mm" viewBox="0 0 1000 1000"', 0.2, {}),
        ('width="50cm" height="50cm" viewBox="0 0 1000 1000"', 0.1, {}),
        ('width="10in" height="10in" viewBox="0 0 254 254"', 0.2, {}),
        ('width="960" height="960"', 200 * 0.0254 / 96, {}),
        ('width="720pt" height="720pt" viewBox="5 5 1000 1000"', 0.0508, {}),
        ('viewBox="0 0 1000 1000"', 2.0, {"unit": "cm"}),
        ('width="100%" viewBox="0 0 300 300"', 0.2, {"unit": "mm"}),
    ],
)
def test_true_size(tmp_path, head, side_m, options):
    pattern = read(tmp_path, '<rect id="a" x="10" y="10" width="200" height="200"/>', head, **options)
    assert [panel.name for panel in pattern.panels] == ["a"]
    assert edges_area(pattern.panels[0].edges) == pytest.approx(side_m**2, rel=1e-6)


@pytest.mark.parametrize("head", ['width="100%" height="100%" viewBox="0 0 9 9"', "", 'width="3furlong"'])
def test_a_drawing_without_size_is_refused(tmp_path, head):
    with pytest.raises(InputError, match="no true size") as raised:
        read(tmp_path, '<rect width="200" height="200"/>', head)
    assert "--unit" in raised.value.hint


def test_pixels_are_said_to_be_assumed(tmp_path):
    assert "96 pixels an inch" in read(tmp_path, '<rect width="200" height="200"/>', 'width="500"').unit


def test_every_command_of_a_path(tmp_path):
    """A closed outline of all commands, absolute and relative, whose area is known piece by piece."""
    path = "M100,100 h100 V150 l0,50 q50,50 0,100 T200,400 c-20,40 -80,40 -100,0 S 110,300 100,300 "
    path += "a50,50 0 0 0 0,-100 A 50 50 0 0 1 100 100 z"
    panel = read(tmp_path, f'<path d="{path}"/>').panels[0]
    drawn = svgelements.Path(path)
    points = np.array([[p.x, p.y] for s in drawn if s.start is not None for p in map(s.point, np.linspace(0, 1, 2001))])
    x, y = points.T
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    assert edges_area(panel.edges) == pytest.approx(1e-6 * area, rel=1e-5)
    shapes = [edge.shape for edge in panel.edges]
    assert shapes.count("quadratic") == 2
    assert shapes.count("cubic") == 2
    assert shapes.count("arc") == 2


def test_transforms_references_and_the_right_way_up(tmp_path):
    body = """<defs><path id="tri" d="M0,0 L200,0 L0,100 Z"/></defs>
      <g transform="translate(100,500) rotate(90)"><g transform="scale(2,1)"><use xlink:href="#tri"/></g></g>"""
    (panel,) = read(tmp_path, body).panels
    assert edges_area(panel.edges) == pytest.approx(0.02, rel=1e-6)
    # rotate(90) takes x to y, which points down: the far corner lies 400 mm below (100, 500), and y is up here
    assert edges_points(panel.edges, 1e-4).min(axis=0) == pytest.approx([0.0, -0.9], abs=1e-6)


def test_ellipses_become_curves(tmp_path):
    body = '<circle id="c" cx="200" cy="200" r="100"/><ellipse id="e" cx="600" cy="600" rx="200" ry="100"/>'
    ellipse, circle = read(tmp_path, body).panels
    assert edges_area(circle.edges) == pytest.approx(0.01 * np.pi, rel=1e-7)
    assert edges_area(ellipse.edges) == pytest.approx(0.02 * np.pi, rel=1e-5)
    assert {edge.shape for edge in circle.edges} == {"arc"}


def test_what_is_no_panel_is_named(tmp_path):
    body = """
      <rect id="panel" x="100" y="100" width="300" height="300"/>
      <rect id="pocket" x="150" y="150" width="50" height="50"/>
      <path id="fold" d="M110,300 L390,300"/><path id="frame" d="M500,500 L900,500"/>
      <rect id="dot" x="500" y="10" width="10" height="10"/>
      <path id="pen" d="M500,700 h400 v4 h-400 z"/>
      <rect id="again" x="100" y="100" width="300" height="300"/>
      <rect id="hidden" style="display:none" x="500" y="100" width="300" height="300"/>
      <image id="photo" width="9" height="9" xlink:href="photo.png"/>
      <text x="200" y="250">front, cut 2</text><text x="900" y="20">scale</text>"""
    job = Job()
    (panel,) = read(tmp_path, body, job=job).panels
    said = "\n".join(job.notes)
    for name in ("frame", "dot", "pen", "again", "photo"):
        assert name in said
    assert (panel.name, panel.notes) == ("panel", ("front, cut 2",))
    assert [edges_length(line.curves) for line in panel.lines] == pytest.approx([0.2, 0.28])


def test_an_outline_drawn_in_pieces_is_joined(tmp_path):
    body = '<path d="M100,100 L300,100 L300,300"/><path d="M300,300 H100"/>'
    body += '<path d="M100,100.05 C 100,200 100,250 100,300"/>'
    (panel,) = read(tmp_path, body).panels
    assert edges_area(panel.edges) == pytest.approx(0.04, rel=1e-3)


def test_where_no_line_is_a_panel_the_likeliest_are_named(tmp_path):
    body = """<path id="pen" d="M100,100 h400 v4 h-400 z"/><rect id="dot" x="500" y="10" width="10" height="10"/>
      <path id="half" d="M100,500 v300 h300"/><path id="tick" d="M800,500 v30"/>"""
    with pytest.raises(FormatError, match="2 are closed, of which pen encloses most, 16 cm² and 4 mm wide") as raised:
        read(tmp_path, body)
    # a pen stroke of 400 by 4 mm is 2 x 1600 / 808 = 3.96 mm wide; the open line's ends are a diagonal apart
    assert "2 are open, of which half is the longest, 600 mm, and ends 424 mm from its start" in raised.value.problem
    assert (raised.value.where, "one closed line" in raised.value.hint) == ("d.svg", True)
    with pytest.raises(FormatError, match="nothing is drawn"):
        read(tmp_path, "")


@pytest.mark.real_data
@pytest.mark.skipif(not BEANIES.exists(), reason="the drawings are not here")
@pytest.mark.parametrize(
    ("name", "entity"),
    [("beanie_g538.svg", "use281"), ("beanie_g542.svg", "path-1-05"), ("beanie_g543.svg", "path-1-9")],
)
def test_pen_strokes_by_others_are_refused_by_name(name, entity):
    with pytest.raises(FormatError, match=f"of which {entity} ") as raised:
        read_pattern(BEANIES / name)
    assert raised.value.where == name


def test_no_panels_no_svg_and_bombs_are_refused(tmp_path):
    with pytest.raises(FormatError, match="no line is a panel"):
        read(tmp_path, '<path d="M0,0 L100,100"/>')
    for text in ("<html/>", "plain", '<svg width="1mm"'):
        (tmp_path / "x.svg").write_text(text)
        with pytest.raises(InputError):
            read_pattern(tmp_path / "x.svg")
    loop = '<g id="a"><use xlink:href="#a"/><rect width="200" height="200"/></g>'
    with pytest.raises(InputError):
        read(tmp_path, loop * 3)


def test_ours_comes_back_whole(tmp_path):
    write_pattern(tmp_path / "r.svg", rich_pattern())
    was, now = (json.loads(json.dumps(record_of(p))) for p in (rich_pattern(), read_pattern(tmp_path / "r.svg")))
    flat_was, flat_now = flattened(was), flattened(now)
    assert flat_was.keys() == flat_now.keys()
    for key, value in flat_was.items():
        assert flat_now[key] == (pytest.approx(value, abs=1e-12) if isinstance(value, float) else value), key


def flattened(value, key=""):
    """Paths of keys -> plain values."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        return {k: v for name, inner in items for k, v in flattened(inner, f"{key}.{name}").items()}
    return {key: value}


def test_ours_has_its_true_size_and_every_panel_on_the_page(tmp_path):
    write_pattern(tmp_path / "o.svg", Pattern("disc", (half_disc(0.3),)))
    root = ElementTree.parse(tmp_path / "o.svg").getroot()
    width, height = (float(root.get(key).removesuffix("mm")) for key in ("width", "height"))
    assert (width, height) == (pytest.approx(640.0, abs=1e-6), pytest.approx(340.0, abs=0.2))
    assert [float(x) for x in root.get("viewBox").split()][2:] == [width, height]
    drawn = svgelements.SVG.parse(tmp_path / "o.svg", ppi=25.4)
    path = next(svgelements.Path(e) for e in drawn.elements() if isinstance(e, svgelements.Path))
    left, top, right, bottom = path.bbox()
    assert (right - left, bottom - top) == (pytest.approx(600.0, rel=1e-5), pytest.approx(300.0, rel=1e-5))
    assert (left, top) == (pytest.approx(20.0, abs=0.2), pytest.approx(20.0, abs=0.2))


@settings(max_examples=25, deadline=None)
@given(panels())
def test_any_panel_comes_back(tmp_path_factory, panel):
    path = tmp_path_factory.mktemp("any") / "a.svg"
    write_pattern(path, Pattern("any", (panel,)))
    (back,) = pattern_of(json.loads(str(parse_svg(str(path), "")["pattern"])), "a").panels
    for a, b in zip(back.edges, panel.edges, strict=True):
        assert (a.kind, len(a.points)) == (b.kind, len(b.points))
        assert a.points == pytest.approx(b.points, abs=1e-9)
        assert a.bulge == pytest.approx(b.bulge, abs=1e-7)
