"""Per-vertex maps for the wearer: strain of the threads, and pressure on the body."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.judge.residual import ElasticEnergies
from vto_pipeline.cloth.judge.strain import gradients, rest_triangles, warp_weft_strains
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

_TOUCHING = 4e-3  # m: a body this near may bear the cloth; skins are 3 mm at most unless asked for


def vertex_maps(mesh: TriangleMesh, rest: RestShape, body: TriangleMesh, fabric: Fabric) -> dict[str, FloatArray]:
    """Return figures per vertex of a draped garment.

    Pressure is the force with which the body holds a vertex up, along the body's normal, over the vertex's area: what
    elastic forces and weight leave, forces being differences of energies (`judge.residual`, in the default models).

    Args:
        mesh: The garment at rest on the body [m].
        rest: Its rest shape.
        body: What it lies on [m], oriented outward.
        fabric: What it is made of.

    Returns:
        strain_warp and strain_weft (relative), shear_rad, and pressure_pa (0 where it does not touch), each of shape
        (V,); strains are means over a vertex's triangles by their area at rest.
    """
    count = len(mesh.vertices)
    laid = rest_triangles(rest.corners(mesh.faces))
    corners = mesh.faces[laid.solid]
    strains = warp_weft_strains(gradients(mesh.vertices, mesh.faces, laid))
    area = np.bincount(corners.ravel(), np.repeat(laid.area, 3), count)
    maps: dict[str, FloatArray] = {}
    for name, strain in zip(("strain_warp", "strain_weft", "shear_rad"), strains.T, strict=True):
        total = np.bincount(corners.ravel(), np.repeat(laid.area * strain, 3), count)
        maps[name] = np.divide(total, area, out=np.zeros(count), where=area > 0.0)

    weave = ElasticEnergies(mesh, rest, fabric)
    force = weave.forces(mesh.vertices)
    force[:, 1] -= GRAVITY * weave.mass
    nearest = SurfaceDistance(body).signed(mesh.vertices)
    outward = (mesh.vertices - nearest.point) * np.where(nearest.distance < 0.0, -1.0, 1.0)[:, None]
    outward /= np.maximum(np.abs(nearest.distance), np.finfo(float).tiny)[:, None]
    push = np.maximum(-np.sum(force * outward, axis=1), 0.0)
    push[nearest.distance >= _TOUCHING] = 0.0
    maps["pressure_pa"] = np.divide(3.0 * push, area, out=np.zeros(count), where=area > 0.0)
    return maps
