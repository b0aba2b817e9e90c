"""What of a run's render meshes is handed out as one file."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from vto_pipeline.errors import InputError
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.render.dress import BODY
from vto_pipeline.stages.entry.shown import shown_parts


def part(name: str) -> GlbPart:
    return GlbPart(name, TriangleMesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))


def outcome(**made: Any) -> Any:
    """A run that has made these artifacts."""
    kinds = [SimpleNamespace(name=name, filename=f"{name}.glb") for name in made]
    return SimpleNamespace(
        folder=Path("RUN"), tables=SimpleNamespace(kinds=kinds), made=made.__contains__, read=made.__getitem__
    )


def test_one_garment_and_its_body_are_as_the_run_has_them() -> None:
    found = shown_parts(outcome(draped="mesh", render_mesh=(part("garment"), part(BODY)), collider="body"))
    assert [one.name for one in found] == ["garment", BODY]


def test_several_garments_have_names_colours_and_one_body() -> None:
    made = {f"{name}_render_mesh": (part("garment"), part(BODY)) for name in ("trousers", "shirt")}
    found = shown_parts(outcome(trousers_draped="mesh", shirt_draped="mesh", **made))
    assert [one.name for one in found] == ["trousers garment", "shirt garment", BODY]
    assert len({one.base_color for one in found}) == 3


def test_a_run_without_a_render_mesh_is_refused() -> None:
    with pytest.raises(InputError, match="no render mesh"):
        shown_parts(outcome(draped="mesh"))
