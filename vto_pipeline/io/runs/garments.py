"""Intermediate files of a garment: labels, openings, rest shape, and the moving body it is draped on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import read_arrays, write_arrays
from vto_pipeline.io.documents import read_json, write_json
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import Opening, RestShape, SurfaceLabels
from vto_pipeline.model.mesh import TriangleMesh


def write_sewn(path: Path, mesh: TriangleMesh) -> None:
    """Write sewn.npz: vertices, faces, and the panels as texture coordinates."""
    assert mesh.texture is not None
    write_arrays(path, {"vertices": mesh.vertices, "faces": mesh.faces, "panels": mesh.texture})


def read_sewn(path: Path) -> TriangleMesh:
    """Read sewn.npz.

    Raises:
        FormatError: an array is missing.
    """
    arrays = read_arrays(path, required=("vertices", "faces", "panels"))
    return TriangleMesh(arrays["vertices"], arrays["faces"], texture=arrays["panels"])


def write_labels(path: Path, labels: SurfaceLabels) -> None:
    """Write labels.npz: garment, observed, confidence, on the surface's vertices.

    A scan's surface holds only what a sensor saw, so `observed` is true for all of it; filling comes later, and
    observed.npz marks it. The array stays because readers of the file rely on it.
    """
    seen = np.ones(len(labels.garment), dtype=bool)
    write_arrays(path, {"garment": labels.garment, "observed": seen, "confidence": labels.confidence})


def read_labels(path: Path) -> SurfaceLabels:
    """Read labels.npz.

    Raises:
        FormatError: an array is missing.
    """
    arrays = read_arrays(path, required=("garment", "confidence"))
    return SurfaceLabels(arrays["garment"], arrays["confidence"])


def write_openings(path: Path, openings: Sequence[Opening]) -> None:
    """Write openings.json."""
    records = [{"loop": o.loop, "perimeter_m": o.perimeter, "center_m": o.center, "normal": o.normal} for o in openings]
    write_json(path, {"openings": records})


def read_openings(path: Path) -> tuple[Opening, ...]:
    """Read openings.json.

    Raises:
        FormatError: not what `write_openings` wrote.
    """
    try:
        return tuple(
            Opening(
                loop=np.array(record["loop"], dtype=np.int32),
                perimeter=float(record["perimeter_m"]),
                center=np.array(record["center_m"], dtype=np.float64),
                normal=np.array(record["normal"], dtype=np.float64),
            )
            for record in read_json(path)["openings"]
        )
    except (KeyError, OverflowError, TypeError, ValueError) as e:
        raise FormatError(f"not a list of openings: {e!r}", where=str(path)) from None


def write_observed(path: Path, observed: NDArray[np.bool_]) -> None:
    """Write observed.npz: one flag per vertex of the garment, shape (V,)."""
    write_arrays(path, {"observed": observed})


def read_observed(path: Path) -> NDArray[np.bool_]:
    """Read observed.npz.

    Raises:
        FormatError: the array is missing.
    """
    return read_arrays(path, required=("observed",))["observed"].astype(bool)


def write_maps(path: Path, maps: Mapping[str, FloatArray]) -> None:
    """Write fit_maps.npz or motion_maps.npz: figures per vertex of the draped mesh, each of shape (V,)."""
    write_arrays(path, dict(maps))


def read_fit_maps(path: Path) -> dict[str, FloatArray]:
    """Read fit_maps.npz.

    Raises:
        FormatError: an array is missing.
    """
    return dict(read_arrays(path, required=("stretch", "clearance_mm")))


def read_motion_maps(path: Path) -> dict[str, FloatArray]:
    """Read motion_maps.npz.

    Raises:
        FormatError: an array is missing.
    """
    return dict(read_arrays(path, required=("stretch", "at_s")))


def write_rest_shape(path: Path, rest: RestShape) -> None:
    """Write rest_shape.npz."""
    flags = {"rest_angles": np.bool_(rest.rest_angles), "regraded": np.bool_(rest.regraded)}
    panels = {} if rest.panels is None else {"panels": rest.panels}
    write_arrays(path, {"positions": rest.positions, "mode": rest.mode, **flags, **panels})


def read_rest_shape(path: Path) -> RestShape:
    """Read rest_shape.npz.

    Raises:
        FormatError: an array is missing.
    """
    arrays = read_arrays(path, required=("positions", "rest_angles", "mode", "regraded"))
    flags = bool(arrays["rest_angles"]), str(arrays["mode"]), bool(arrays["regraded"])
    return RestShape(arrays["positions"], *flags, arrays.get("panels"))


def write_collider(path: Path, body: MovingBody) -> None:
    """Write collider.npz."""
    write_arrays(path, {"keyframes": body.keyframes, "faces": body.faces})


def read_collider(path: Path) -> MovingBody:
    """Read collider.npz.

    Raises:
        FormatError: an array is missing.
    """
    arrays = read_arrays(path, required=("keyframes", "faces"))
    return MovingBody(arrays["keyframes"], arrays["faces"])
