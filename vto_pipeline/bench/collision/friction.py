"""Friction against closed forms: the inclined plane, the capstan, stick and slip of an elastica, a pile at rest.

Errors are relative ("error_share"), with what is asked for beside them ("allowed_share").
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.collision.capstan import slipping_ratio
from vto_pipeline.bench.collision.scenes import LAYERS, pile
from vto_pipeline.bench.collision.stick_slip import slipping_shortening
from vto_pipeline.bench.physics.closed_forms import capstan, slide
from vto_pipeline.bench.physics.elastica import slipping_strip
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.cloth import Plane, simulate
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

Settings = Mapping[str, Value]
Error = Callable[[Settings, float], Mapping[str, float]]
"""From settings and a coefficient of friction to what is measured, "error_share" among it."""

FRICTIONS = (0.1, 0.3, 0.5, 0.6, 0.9)
METHODS: tuple[dict[str, Value], ...] = (
    {"solver": "newton"},
    {"solver": "newton", "substeps": 40.0, "travel_mm": 0.2},
    {"solver": "xpbd"},
    {"solver": "backward_euler"},
    {"solver": "symplectic_euler"},
    {"solver": "backward_euler", "contact_forces": True},
    {"solver": "symplectic_euler", "contact_forces": True},
)

_WRAP = np.pi
_STEEPER = 1.2  # tan θ over μ of a slide
_BRACKET = 0.1  # of μ: where the limit is sought on either side
_HALVINGS = 10
_STIRS = 2e-4  # excess of tan θ over μ whose slide counts as one, as a share
_SECONDS = 1.0


def friction_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """All of them."""
    for settings in METHODS[:5:2] if quick else METHODS:
        for friction in FRICTIONS[:2] if quick else FRICTIONS:
            yield _row(watch, "incline", settings, friction, 0.005, _limit_error)
            yield _row(watch, "slide", settings, friction, 0.01, _slide_error)
    for friction in (0.3,) if quick else (0.1, 0.3, 0.5):  # loaded so slowly that other methods take minutes
        yield _row(watch, "capstan", METHODS[0], friction, 0.03, _capstan_error)
    for friction in (0.3,) if quick else (0.1, 0.2, 0.3):
        yield _row(watch, "stick-slip", METHODS[0], friction, 0.05, _stick_slip_error)
    for seconds, count in ((1.0, 4),) if quick else ((10.0, 8),):
        measure = partial(_pile, count, seconds)
        yield watch.row("pile at rest", "default", {"seconds": seconds}, LAYERS * count**2, measure)


def incline(settings: Settings, tangent: float, friction: float) -> tuple[float, int]:
    """Return how far a small sheet slides in a second down a slope of this tangent [m], and in how many steps."""
    slope, skin = np.arctan(tangent), 1e-3
    normal = np.array([np.sin(slope), np.cos(slope), 0.0])
    along = np.array([np.cos(slope), -np.sin(slope), 0.0])
    u, v = (g.ravel() for g in np.meshgrid(np.linspace(-0.05, 0.05, 4), np.linspace(-0.05, 0.05, 4), indexing="ij"))
    start = u[:, None] * along + v[:, None] * np.array([0.0, 0.0, 1.0]) + skin * normal
    a = np.array([4 * i + j for i in range(3) for j in range(3)])
    faces = np.vstack([np.column_stack([a, a + 1, a + 5]), np.column_stack([a, a + 5, a + 4])]).astype(np.int32)
    ended = simulate(
        TriangleMesh(start, faces),
        Fabric("block", 0.2, 1e-3, 1e3, 1e3, 5e2, 0.0, 1e-5, 1e-5, 0.0, friction),
        colliders=[Plane((0.0, 0.0, 0.0), (normal[0], normal[1], 0.0), friction)],
        seconds=_SECONDS,
        settings={**settings, "skin_mm": 1e3 * skin},
    )
    return float(((ended.positions - start) @ along).mean()), int(str(ended.report["steps"]))


def slope_limit(settings: Settings, friction: float) -> float:
    """Return the tangent of the steepest slope on which the sheet holds, by halving."""
    low, high = (1.0 - _BRACKET) * friction, (1.0 + _BRACKET) * friction
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        stirs = 0.5 * GRAVITY * np.cos(np.arctan(middle)) * _STIRS * friction * _SECONDS**2
        low, high = (low, middle) if incline(settings, middle, friction)[0] > stirs else (middle, high)
    return 0.5 * (low + high)


def _row(watch: Watch, scene: str, settings: Settings, friction: float, allowed: float, error: Error) -> Row:
    method, budget = str(settings["solver"]), {key: value for key, value in settings.items() if key != "solver"}
    measure = partial(_measured, partial(error, settings), friction, allowed)
    return watch.row(f"{scene} {friction:g}", method, {"friction": friction, **budget}, 0, measure)


def _measured(error: Callable[[float], Mapping[str, float]], friction: float, allowed: float) -> Measured:
    found, seconds = clocked(error, friction)
    return Timing(seconds), {**found, "allowed_share": allowed}


def _limit_error(settings: Settings, friction: float) -> dict[str, float]:
    found = slope_limit(settings, friction)
    return {"error_share": abs(found / friction - 1.0), "tangent": found}


def _slide_error(settings: Settings, friction: float) -> dict[str, float]:
    found, steps = incline(settings, _STEEPER * friction, friction)
    wanted = slide(friction, np.arctan(_STEEPER * friction), GRAVITY, _SECONDS / steps, steps)
    return {"error_share": abs(found / wanted - 1.0), "slid_mm": 1e3 * found}


def _capstan_error(settings: Settings, friction: float) -> dict[str, float]:
    found = slipping_ratio(settings, friction)
    return {"error_share": abs(found / capstan(friction, _WRAP) - 1.0), "ratio": found}


def _stick_slip_error(settings: Settings, friction: float) -> dict[str, float]:
    found, wanted = slipping_shortening(settings, friction), slipping_strip(friction)
    return {"error_share": abs(found / wanted - 1.0), "shortening": found}


def _pile(count: int, seconds: float) -> Measured:
    """Five layers that have come to rest: how far the vertex that moves most moves in the seconds after."""
    scene = pile(count)
    before, first = clocked(scene.run)
    after, second = clocked(replace(scene, seconds=scene.seconds + seconds).run)
    drift = float(np.linalg.norm(after.positions - before.positions, axis=1).max())
    return Timing(first + second), {"drift_mm": 1e3 * drift, "allowed_mm": 0.1}
