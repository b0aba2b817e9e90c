"""Rest shape of a garment from its hanging shape on the body it was scanned on.

As scanned, a garment sags a second time by what its own weight had stretched it. The way out is to simulate that: let
it hang on the same body, and shorten each edge by as much as it was stretched there, l₀ <- l₀ · scanned / simulated.
Once is enough where strains are small; repeated, the garment at rest on the body becomes the scan (the problem of Ly et
al. 2018, "Inverse elastic shell design with contact and friction", by a fixed-point iteration). Lengths are corrected,
not places, so that a fold that swings does no harm. What holds without being stretched by weight, such as a band that
is tight about the waist, cannot be told from its shape, and stays as scanned.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.rest_shape.edge_length_embedding import embed_edge_lengths
from vto_pipeline.cloth.rest_shape.from_panels import panels_of, panels_on
from vto_pipeline.errors import ConfigError
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

_LEAST_GAIN = 0.95  # a round that leaves more than this of the distance is the last


class RestShapeConfig(Config):
    """How the rest shape is found."""

    mode: Literal["auto", "panels", "as_scanned", "gravity_removed", "inverse"] = Field(
        default="auto",
        description="With auto, panels are taken where the file has them, else the shape as scanned. With panels, "
        "texture coordinates are the cut, scaled if they must be. With as_scanned, lengths and areas are kept. "
        "With gravity_removed, the stretch by weight on the source body is taken off; inverse repeats that until the "
        "result matches the scan",
    )
    rest_angles: bool = Field(
        default=False, description="Whether the scan's folds are kept as creases; else the cloth is flat at rest"
    )
    rounds: int = Field(default=6, ge=1, le=100, description="Most corrections with inverse")
    reproduced_mm: float = Field(
        default=0.3,
        gt=0,
        le=100,
        description="Mean distance from simulated garment to scan at which to stop [mm]",
    )
    bound: float = Field(
        default=0.1,
        gt=0,
        lt=1,
        description="Largest relative change of an edge against the scan, so that noise is not fitted",
    )
    target_error_mm: float = Field(
        default=0.2, gt=0, le=100, description="Predicted rms motion below which a simulated garment is at rest [mm]"
    )
    settle_seconds: float = Field(
        default=20.0, gt=0, le=600, description="Longest simulated time to reach rest, per round [s]"
    )


def rest_shape(
    mesh: TriangleMesh,
    config: RestShapeConfig,
    job: Job,
    body: TriangleMesh | None = None,
    fabric: Fabric | None = None,
    given: TriangleMesh | None = None,
) -> RestShape:
    """Return the rest shape of a garment.

    Args:
        mesh: Simulation mesh, where it was scanned [m].
        config: The mode, and how far to go.
        job: Receives what was assumed; measures scan_distance_mm and its 95th percentile before and after.
        body: What it was on then [m], for modes that simulate.
        fabric: What it is made of, for the same.
        given: The file that the mesh was made of, in the same place [m]; panels are its texture coordinates.

    Raises:
        ConfigError: a mode that needs what is not known: body and fabric, or texture coordinates.
        ComputationError: the garment cannot be simulated on that body.
    """
    if config.mode in ("auto", "panels") and given is not None and given.texture is not None:
        panels = panels_of(given, config.mode == "panels", job)
        if panels is not None:
            return RestShape(mesh.vertices, config.rest_angles, "panels", panels=panels_on(mesh, given, panels, job))
    elif config.mode == "panels":
        raise ConfigError(
            "rest_shape.mode: panels takes the texture coordinates of a garment file for its cut, and there are none",
            hint="give an OBJ or glTF file with texture coordinates for every face, or set mode: as_scanned",
        )
    if config.mode in ("auto", "as_scanned"):
        job.note("rest shape taken as scanned; it includes the stretch under its own weight")
        return RestShape(mesh.vertices, config.rest_angles, "as_scanned")
    if body is None or fabric is None:
        raise ConfigError(
            f"rest_shape.mode: {config.mode} simulates the garment on the body it was scanned on, and "
            f"{'that body' if body is None else 'the fabric'} is not known",
            hint="give the mannequin (--source-body), or set mode: as_scanned",
        )
    return _Inverse(mesh, config, job, body, fabric).run()


class _Inverse:
    """The rounds, and what they share."""

    def __init__(
        self, mesh: TriangleMesh, config: RestShapeConfig, job: Job, body: TriangleMesh, fabric: Fabric
    ) -> None:
        self._mesh = mesh
        self._config = config
        self._job = job
        self._body = body
        self._fabric = fabric
        self._pairs = edges(mesh)
        self._scanned = _lengths(mesh.vertices, self._pairs)

    def run(self) -> RestShape:
        """Return the rest shape whose simulation is nearest to the scan."""
        config = self._config
        rounds = config.rounds if config.mode == "inverse" else 1
        wanted = self._scanned
        rest = best = self._mesh.vertices
        simulated, distance, spread = self._simulate(rest, 0.0)
        self._job.measure(scan_distance_before_mm=distance, scan_distance_before_p95_mm=spread)
        nearest = distance, spread
        for k in range(rounds):
            if distance <= config.reproduced_mm:
                break
            stretched = _lengths(simulated, self._pairs) / self._scanned
            low, high = (1.0 - config.bound) * self._scanned, (1.0 + config.bound) * self._scanned
            wanted = np.clip(wanted / stretched, low, high)
            rest = embed_edge_lengths(rest, self._pairs, wanted)
            before = distance
            simulated, distance, spread = self._simulate(rest, (k + 1) / (rounds + 1))
            if distance < nearest[0]:
                best, nearest = rest, (distance, spread)
            if distance > _LEAST_GAIN * before:
                break
        self._tell(best, *nearest)
        return RestShape(best, config.rest_angles, config.mode)

    def _simulate(self, rest: FloatArray, done: float) -> tuple[FloatArray, float, float]:
        """Return the garment at rest on the body [m], and its distance to the scan, mean and p95 [mm]."""
        config = self._config
        self._job.progress(done, "hanging the garment on the body it was scanned on")
        settings = {
            "place": "as_it_stands",
            "target_error_mm": config.target_error_mm,
            "settle_seconds": config.settle_seconds,
        }
        garment = Garment(self._mesh, RestShape(rest, config.rest_angles))
        found = drape(garment, self._body, self._fabric, settings, Job(force_all=self._job.force_all)).mesh.vertices
        apart = 1e3 * np.linalg.norm(found - self._mesh.vertices, axis=1)
        return found, float(apart.mean()), float(np.percentile(apart, 95))

    def _tell(self, rest: FloatArray, distance: float, spread: float) -> None:
        change = _lengths(rest, self._pairs) / self._scanned - 1.0
        before = self._job.metrics["scan_distance_before_mm"]
        self._job.measure(
            scan_distance_mm=distance,
            scan_distance_p95_mm=spread,
            length_change_median_share=float(np.median(change)),
            length_change_p95_share=float(np.percentile(np.abs(change), 95)),
        )
        self._job.note(
            f"rest shape: simulated on the source body, the garment is {distance:.2f} mm from the scan "
            f"on average ({before:.2f} mm when taken as scanned)"
        )
        if distance > self._config.reproduced_mm and self._config.mode == "inverse":
            self._job.warn(f"rest shape: the scan is reproduced only to {distance:.2f} mm")


def _lengths(positions: FloatArray, pairs: IntArray) -> FloatArray:
    return np.linalg.norm(positions[pairs[:, 1]] - positions[pairs[:, 0]], axis=1)
