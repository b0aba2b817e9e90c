"""Where a garment belongs on a body it was never on: the shift at which the body fills it best.

Body and garment, its openings closed, are solids of small cubes. For every shift at once (by FFT): cubes of body
inside the garment count for it, cubes of cloth inside the body against it. No landmark is needed, so a skirt is as
good as a shirt.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.fft import irfftn, next_fast_len, rfftn

from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config


class PlaceConfig(Config):
    """How a garment without a source body is put on the body."""

    place: str = Field(
        "auto", pattern="^(auto|as_it_stands|align)$", description="auto: align where it does not stand well"
    )
    cube_mm: float = Field(15.0, ge=5, le=50, description="Resolution of the search for the best place [mm]")
    cloth_in_body: float = Field(
        2.0, ge=0, le=100, description="Weight of cloth inside the body against body inside the garment"
    )
    stands_well: float = Field(
        0.95, ge=0, le=1, description="auto leaves a garment whose place is this share as good as the best"
    )


def place(garment: TriangleMesh, body: TriangleMesh, config: PlaceConfig, job: Job) -> TriangleMesh:
    """Return the garment shifted to where the body fills it best; units and axes are taken to be right.

    Args:
        garment: As it stands [m].
        body: Where it shall go [m].
        config: Search and threshold.
        job: Told what was done.
    """
    if config.place == "as_it_stands":
        job.note("garment left where it stands, as asked")
        return garment
    cube = 1e-3 * config.cube_mm
    shift, share = _best_shift(garment, body, cube, config.cloth_in_body)
    if config.place == "auto" and share >= config.stands_well:
        job.note(f"garment left where it stands: {share:.0%} as good as the best place")
        return garment
    job.note(
        f"garment moved by ({', '.join(f'{1e3 * part:.0f}' for part in shift)}) mm (x, y, z) to where the body "
        f"fills it best; as it stood, {max(share, 0.0):.0%} as good"
    )
    return TriangleMesh(garment.vertices + shift, garment.faces, garment.colors)


def _best_shift(garment: TriangleMesh, body: TriangleMesh, cube: float, penalty: float) -> tuple[FloatArray, float]:
    """Return the best shift [m], shape (3,), and how good no shift is, as a share of the best."""
    body_low, garment_low = body.vertices.min(axis=0), garment.vertices.min(axis=0)
    # garment cubes lie on the body's lattice, so that the shifts found include "none"
    garment_low = body_low + np.floor((garment_low - body_low) / cube) * cube
    body_solid = _solid(body, body_low, cube)
    inside = _solid(_closed(garment), garment_low, cube)
    cloth = np.zeros_like(inside)
    points = np.vstack([garment.vertices, garment.vertices[garment.faces].mean(axis=1)])
    cloth[tuple(((points - garment_low) / cube).astype(np.int64).T)] = True
    worth = (inside & ~cloth).astype(np.float64) - penalty * cloth
    size = [next_fast_len(int(a + b)) for a, b in zip(body_solid.shape, worth.shape, strict=True)]
    score = irfftn(rfftn(body_solid.astype(np.float64), size) * np.conj(rfftn(worth, size)), size)
    best = np.unravel_index(int(np.argmax(np.round(score, 6))), score.shape)
    steps = np.array([k if k < b else k - n for k, n, b in zip(best, size, body_solid.shape, strict=True)])
    stay = np.round((garment_low - body_low) / cube).astype(np.int64)
    reach = np.array(worth.shape)
    overlaps = ((stay < np.array(body_solid.shape)) & (stay > -reach)).all()
    here = score[tuple(stay % np.array(size))] if overlaps else 0.0
    return (steps - stay) * cube, float(here / max(score[best], 1e-12))


def _solid(mesh: TriangleMesh, low: FloatArray, cube: float) -> NDArray[np.bool_]:
    """Return which cubes, counted from `low`, have their centre inside the mesh, whichever way it is oriented."""
    import igl

    counts = np.ceil((mesh.vertices.max(axis=0) - low) / cube).astype(np.int64) + 1
    centres = low + cube * (np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1) + 0.5)
    winding = igl.fast_winding_number(mesh.vertices, mesh.faces.astype(np.int64), centres.reshape(-1, 3))
    return (np.abs(winding) > 0.5).reshape(counts)


def _closed(garment: TriangleMesh) -> TriangleMesh:
    """Return the garment with a fan over each opening."""
    vertices, faces = [garment.vertices], [garment.faces]
    count = len(garment.vertices)
    for loop in boundary_loops(garment):
        vertices.append(garment.vertices[loop].mean(axis=0, keepdims=True))
        faces.append(np.column_stack([np.roll(loop, -1), loop, np.full(len(loop), count)]).astype(np.int32))
        count += 1
    return TriangleMesh(np.vstack(vertices), np.vstack(faces))
