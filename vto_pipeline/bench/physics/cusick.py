"""The Cusick drape test: a disc of cloth on a smaller disc, and the share of the ring in its shadow.

The four fabrics of Matsudaira et al. 2015 (J. Textile Eng. 61(6)) whose mass, thickness, bending rigidity and
hysteresis were measured together with the drape coefficient. Their resistance in the plane was not: what is assumed is
in `MEMBRANE` and `SHEAR`. As in the test, the cloth is held between discs, so what lies on the disc does not move.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.physics.cantilever import MESHES
from vto_pipeline.bench.physics.meshes import MeshKind, disc
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.model.build import ClothModel, at_rest, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.rest.equilibrium import EquilibriumConfig, equilibrium
from vto_pipeline.cloth.solvers import SOLVERS
from vto_pipeline.errors import DivergedError
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh

MEMBRANE = 1000.0  # warp and weft, assumed [N/m]
SHEAR = 40.0  # assumed: a woven of medium shear rigidity, 0.7 gf/(cm deg) [N/m]

GEOMETRIES = {"30/18": (0.15, 0.09), "25.4/12.7": (0.127, 0.0635)}
"""Radius of the specimen and of the disc [m]; BS 5058 and ISO 9073-9, and JIS L 1096."""

_PIXEL = 2.5e-4  # of the shadow [m]
_STEP, _LONGEST = 1.0 / 200.0, 20.0  # [s]
_DAMPING = 4.0  # [1/s]
_STILL = 1e-6  # [m/s]
_UNEVENNESS = 1e-3  # of the start, of the specimen's radius: where the folds come from


@dataclass(frozen=True)
class Measurement:
    """A fabric and its drape as measured.

    Args:
        density: [kg/m²].
        thickness: [m].
        rigidity: B, mean of the directions [N·m].
        hysteresis: 2HB [N].
        drape: Drape coefficient, a share.
        nodes: Folds.
    """

    density: float
    thickness: float
    rigidity: float
    hysteresis: float
    drape: float
    nodes: int

    def fabric(self, name: str) -> Fabric:
        """Return the fabric, with what was not measured assumed."""
        b = self.rigidity
        return Fabric(name, self.density, self.thickness, MEMBRANE, MEMBRANE, SHEAR, 0.0, b, b, self.hysteresis, 0.3)


MEASURED = {
    "MAT-A": Measurement(0.1238, 0.497e-3, 1.157185e-05, 1.216025e-03, 0.829, 2),
    "MAT-B": Measurement(0.1629, 0.407e-3, 6.570456e-06, 3.236195e-04, 0.498, 5),
    "MAT-C": Measurement(0.1165, 0.340e-3, 7.551120e-06, 2.843929e-04, 0.507, 5),
    "MAT-F": Measurement(0.1043, 0.226e-3, 1.863263e-06, 6.864655e-05, 0.283, 7),
}
"""Cotton broad, wool tropical, polyester tropical, polyester faille; KES-FB2, read in a transcription."""


@dataclass(frozen=True)
class Specimen:
    """A disc of cloth over its support.

    Args:
        model: The cloth.
        start: Nearly flat [m], shape (V, 3).
        radius, support: [m].
    """

    model: ClothModel
    start: FloatArray
    radius: float
    support: float


def specimen(
    fabric: Fabric,
    geometry: str,
    kind: MeshKind,
    edge: float,
    *,
    bending: str = "shape_operator",
    hysteresis: bool = False,
    seed: int = 0,
) -> Specimen:
    """Return a disc of this fabric.

    Args:
        fabric: What it is made of.
        geometry: Of `GEOMETRIES`.
        kind: Of mesh.
        edge: [m].
        bending: A model of `Materials`.
        hysteresis: With internal friction.
        seed: Of the unevenness it starts with, and of an irregular mesh.
    """
    radius, support = GEOMETRIES[geometry]
    points, faces = disc(kind, radius, edge, support, seed)
    flat = np.column_stack([points[:, 0], np.zeros(len(points)), -points[:, 1]])
    away = np.linalg.norm(points, axis=1)
    held = np.flatnonzero(away < support * (1.0 + 1e-9))
    model = build_cloth(
        TriangleMesh(flat, faces),
        RestShape(flat),
        fabric,
        pinned=held,
        materials=checked(Materials, {"bending": bending, "hysteresis": hysteresis}),
    )
    start = flat.copy()
    rise = np.clip((away - support) / (radius - support), 0.0, 1.0)
    angle, rng = np.arctan2(points[:, 1], points[:, 0]), np.random.default_rng(seed)
    for waves in range(2, 13):  # smooth, of no preferred number
        start[:, 1] += _UNEVENNESS * radius * rise**2 * rng.normal() * np.cos(waves * angle + rng.uniform(0, 2 * np.pi))
    return Specimen(model, start, radius, support)


def drape_coefficient(positions: FloatArray, faces: IntArray, radius: float, support: float) -> float:
    """Return (shadow - disc) / (specimen - disc), with the shadow of a cloth from above, on a raster.

    Args:
        positions: [m], shape (V, 3), the axis of the disc plumb through the origin.
        faces: Shape (F, 3).
        radius, support: Of specimen and disc [m].
    """
    count = int(np.ceil(2.2 * radius / _PIXEL))
    shade = np.zeros((count, count), dtype=bool)
    corners = positions[faces][:, :, [0, 2]] / _PIXEL + 0.5 * count
    for (ax, ay), (bx, by), (cx, cy) in corners:
        turn = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if turn == 0.0:
            continue
        x0, x1 = int(max(0, np.floor(min(ax, bx, cx)))), int(min(count, np.ceil(max(ax, bx, cx)) + 1))
        y0, y1 = int(max(0, np.floor(min(ay, by, cy)))), int(min(count, np.ceil(max(ay, by, cy)) + 1))
        x, y = np.arange(x0, x1)[:, None] + 0.5, np.arange(y0, y1)[None, :] + 0.5
        u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / turn
        v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / turn
        shade[x0:x1, y0:y1] |= (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    shadow = shade.sum() * _PIXEL**2
    return float((shadow - np.pi * support**2) / (np.pi * (radius**2 - support**2)))


def fold_count(positions: FloatArray, flat: FloatArray, radius: float) -> int:
    """Return how many maxima the outline has, by the radius of the rim over its angle, wrinkles under 2 mm left out."""
    rim = np.flatnonzero(np.linalg.norm(flat[:, [0, 2]], axis=1) > radius * (1.0 - 1e-6))
    order = rim[np.argsort(np.arctan2(flat[rim, 2], flat[rim, 0]))]
    r = np.linalg.norm(positions[order][:, [0, 2]], axis=1)
    r = (np.roll(r, 1) + r + np.roll(r, -1)) / 3.0
    start = int(np.argmin(r))
    folds, low, high, rising = 0, r[start], r[start], True
    for value in np.append(np.roll(r, -start), r[start]):
        if rising:
            high = max(high, value)
            if value < high - 2e-3 and high > low + 2e-3:
                folds, rising, low = folds + 1, False, value
        else:
            low = min(low, value)
            if value > low + 2e-3:
                rising, high = True, value
    return folds


def cusick_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Each fabric at rest, over resolutions, kinds of mesh and seeds; and let fall, without and with friction."""
    if quick:
        for name in MEASURED:
            yield _row(watch, "30/18", name, "elastic", "irregular", 0.015, 0)
        return
    for geometry in GEOMETRIES:
        for name in MEASURED:
            for kind in MESHES:
                for edge in (0.015, 0.010, 0.0075):
                    for seed in (0, 1, 2) if edge == 0.010 else (0,):
                        yield _row(watch, geometry, name, "elastic", kind, edge, seed)
            for method in ("elastic, let fall", "with 2HB, let fall"):
                for edge in (0.015, 0.010):
                    for seed in (0, 1, 2):
                        yield _row(watch, geometry, name, method, "irregular", edge, seed)


def _row(watch: Watch, geometry: str, name: str, method: str, kind: MeshKind, edge: float, seed: int) -> Row:
    fabric = MEASURED[name]
    one = specimen(fabric.fabric(name), geometry, kind, edge, hysteresis="2HB" in method, seed=seed)

    def measure() -> Measured:
        rest, seconds = clocked(let_fall if "fall" in method else at_minimum, one)
        drape = drape_coefficient(rest, one.model.faces, one.radius, one.support)
        return Timing(seconds), {
            "drape_error_share": drape - fabric.drape,
            "drape_share": drape,
            "measured_share": fabric.drape,
            "nodes": float(fold_count(rest, one.start, one.radius)),
            "nodes_measured": float(fabric.nodes),
        }

    settings: dict[str, Value] = {"fabric": name, "mesh": kind, "edge_mm": 1e3 * edge, "seed": seed}
    return watch.row(f"Cusick {geometry}", method, settings, len(one.start), measure)


def at_minimum(one: Specimen) -> FloatArray:
    """Return the positions in the minimum of energy that Newton finds [m], shape (V, 3)."""
    limits = EquilibriumConfig(tolerance=1e-6, iterations=2000)
    return equilibrium(one.model, one.start, limits).positions


def let_fall(one: Specimen) -> FloatArray:
    """Return the positions where the cloth comes to rest when it is let go [m], shape (V, 3).

    What is lost to friction depends on the way, so this is the way of the test.

    Raises:
        DivergedError: it still moves after `_LONGEST`.
    """
    made: Any = SOLVERS["newton"]
    method = made(one.model, damping=_DAMPING)
    state = at_rest(one.start)
    while state.time < _LONGEST:
        state = method.advance(state, empty_contacts(len(one.start)), _STEP, 20)
        if np.abs(state.velocities).max() < _STILL:
            rest: FloatArray = state.positions
            return rest
    raise DivergedError(f"still moves by {np.abs(state.velocities).max():.1e} m/s after {_LONGEST} s")
