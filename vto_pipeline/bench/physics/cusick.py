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
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.model.build import at_rest
from vto_pipeline.cloth.solvers import SOLVERS
from vto_pipeline.cloth.swatch.disc import DrapeTest, Specimen, at_minimum, drape_coefficient, specimen
from vto_pipeline.cloth.swatch.meshes import MeshKind
from vto_pipeline.errors import DivergedError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric

MEMBRANE = 1000.0  # warp and weft, assumed [N/m]
SHEAR = 40.0  # assumed: a woven of medium shear rigidity, 0.7 gf/(cm deg) [N/m]

GEOMETRIES = {"30/18": DrapeTest(), "25.4/12.7": DrapeTest(0.127, 0.0635)}
"""BS 5058 and ISO 9073-9, and JIS L 1096."""

_STEP, _LONGEST = 1.0 / 200.0, 20.0  # [s]
_DAMPING = 4.0  # [1/s]
_STILL = 1e-6  # [m/s]


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
    one = specimen(fabric.fabric(name), GEOMETRIES[geometry], kind, edge, hysteresis="2HB" in method, seed=seed)

    def measure() -> Measured:
        rest, seconds = clocked(let_fall if "fall" in method else at_minimum, one)
        drape = drape_coefficient(rest, one.model.faces, one.test)
        return Timing(seconds), {
            "drape_error_share": drape - fabric.drape,
            "drape_share": drape,
            "measured_share": fabric.drape,
            "nodes": float(fold_count(rest, one.start, one.test.radius)),
            "nodes_measured": float(fabric.nodes),
        }

    settings: dict[str, Value] = {"fabric": name, "mesh": kind, "edge_mm": 1e3 * edge, "seed": seed}
    return watch.row(f"Cusick {geometry}", method, settings, len(one.start), measure)


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
