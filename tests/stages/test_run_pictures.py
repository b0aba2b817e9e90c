"""The small picture of a run: what is drawn, where, and when it is drawn anew."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render import pictures as render
from vto_pipeline.stages.entry.outcome import Outcome
from vto_pipeline.stages.entry.pictures import draw_outcome
from vto_pipeline.stages.entry.planning import catalogue


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> TriangleMesh:
    """A box with outward faces."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return TriangleMesh(np.array(low) + corners * (np.array(high) - low), np.array(faces))


def outcome(run: Path, **values: object) -> Outcome:
    """A run that made these artifacts."""
    (run / "out").mkdir(parents=True, exist_ok=True)
    tables = catalogue()
    for name, value in values.items():
        kind = tables.kind(name)
        kind.write(run / "out" / kind.filename, value)
    return Outcome(run, {"wanted": list(values), "stages": []}, tables)


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def test_a_drape_is_drawn_on_its_body(tmp_path: Path) -> None:
    body, shirt = block((-0.2, 0.0, -0.1), (0.2, 1.8, 0.1)), block((-0.3, 0.9, -0.2), (0.3, 1.4, 0.2))
    collider = MovingBody(body.vertices[np.newaxis], body.faces)
    both = draw_outcome(outcome(tmp_path / "rows/a", draped=shirt, collider=collider), tmp_path)
    picture = pixels(tmp_path / both)
    assert picture.shape == (192, 144, 3)
    inked = (picture < 250).any(axis=2)
    rows, columns = np.nonzero(inked)
    assert np.ptp(rows) > 160  # the body fills the height
    warm = inked & (picture[..., 0] - picture[..., 2] > 15)
    assert 0.3 < warm.sum() / inked.sum() < 0.75  # 1.3 m of body, 0.4 m wide, beside 0.5 m of shirt, 0.6 m wide: 0.63
    assert np.ptp(columns[(rows > 40) & (rows < 90)]) > np.ptp(columns[rows > 120])  # the shirt is wider


def test_what_was_drawn_before_is_not_drawn_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shirt = block((0, 0, 0), (1, 1, 1))
    first = draw_outcome(outcome(tmp_path / "rows/a", garment=shirt), tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(render, "render_picture", lambda *_, **__: pytest.fail("drawn again"))
        assert draw_outcome(outcome(tmp_path / "rows/b", garment=shirt), tmp_path) == first
    other = draw_outcome(outcome(tmp_path / "rows/a", garment=block((0, 0, 0), (1, 2, 1))), tmp_path)
    assert other != first
    assert len(list((tmp_path / "pictures").iterdir())) == 2


def test_without_a_mesh_there_is_no_picture(tmp_path: Path) -> None:
    assert draw_outcome(outcome(tmp_path / "rows/a"), tmp_path) == ""
    flat = TriangleMesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    assert draw_outcome(outcome(tmp_path / "rows/b", garment=flat), tmp_path) == ""
    assert not list(tmp_path.glob("pictures/*"))
