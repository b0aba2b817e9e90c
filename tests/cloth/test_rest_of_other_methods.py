"""What a drape says of its distance to rest by a method that leaves forces over."""

import numpy as np
import pytest
from cloth_scenes import tube

from vto_pipeline.cloth.drape import drape
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

STANDS = {"place": "as_it_stands"}


def cone(around: int, rings: int, low: float, high: float, at_floor: float, closed: bool = False) -> TriangleMesh:
    """A tube that narrows upward, by 0.14 m in a metre."""
    mesh = tube(1.0, high - low, around, rings, base=low)
    y = mesh.vertices[:, 1]
    ends = closed & ((y < low + 1e-9) | (y > high - 1e-9))
    radius = (at_floor - 0.14 * y) * np.where(ends, 1e-3, 1.0)
    return TriangleMesh(mesh.vertices * np.column_stack([radius, np.ones_like(y), radius]), mesh.faces)


def test_xpbd_tells_how_far_it_is_from_where_newton_comes_to_rest():
    skirt, body = cone(24, 12, 0.1, 0.7, 0.212), cone(48, 40, 0.0, 1.0, 0.2, closed=True)
    fabric, job = read_fabric("cotton_poplin"), Job()
    found = drape(skirt, body, fabric, settings={"solver": "xpbd", "settle_seconds": 1.0, **STANDS}, job=job)
    assert not found.audit["settled"]
    assert found.audit["residual"] > 10.0  # weights: out of balance, though it hardly moves
    on = drape(Garment(found.mesh, RestShape(skirt.vertices)), body, fabric, settings=STANDS)
    assert on.audit["settled"]
    apart = 1e3 * np.sqrt(((on.mesh.vertices - found.mesh.vertices) ** 2).sum(axis=1).mean())
    assert apart / 1.5 < found.trace[-1].error_mm < 1.5 * apart
    assert any("newton moved the cloth by" in note for note in job.notes)
    assert f"{found.trace[-1].error_mm:.1f} mm of motion predicted" in job.warnings[-1]


@pytest.mark.parametrize("solver", ["newton", None])
def test_what_comes_to_rest_is_not_measured_twice(solver):
    skirt, body, job = cone(24, 12, 0.1, 0.7, 0.212), cone(48, 40, 0.0, 1.0, 0.2, closed=True), Job()
    found = drape(skirt, body, read_fabric("cotton_poplin"), settings={"solver": solver, **STANDS}, job=job)
    assert found.audit["settled"]
    assert not any("newton moved" in note for note in job.notes)
