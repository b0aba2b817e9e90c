"""A skirt: a tube about both legs, held by its waistband."""

from __future__ import annotations

import numpy as np

from vto_pipeline.bench.samples.garments.tailoring import mesh_garment_field, waistband
from vto_pipeline.bench.samples.garments.wearer import Wearer
from vto_pipeline.model.garment import Garment, RestShape


def make_skirt(
    wearer: Wearer,
    edge_mm: float = 12.0,
    *,
    clearance: float = 0.008,
    flare: float = 0.25,
    waist_reduction: float = 0.15,
) -> Garment:
    """Return a skirt that ends above the knee.

    Args:
        wearer: Whom it is cut for.
        edge_mm: Length of its edges [mm].
        clearance: Its least gap to the body [m].
        flare: How much wider it becomes, a metre of height.
        waist_reduction: By which share its band is narrower than it is worn.
    """
    top, hem = wearer.waist, wearer.knee + 0.06
    reach = np.array([0.45, 0.0, 0.45])
    mesh = mesh_garment_field(
        lambda points: wearer.tube(points, top + 0.03, hem - 0.03, clearance, flare),
        np.array([0.0, hem - 0.03, 0.0]) - reach,
        np.array([0.0, top + 0.03, 0.0]) + reach,
        [lambda points: top - points[:, 1], lambda points: points[:, 1] - hem],
        edge_mm,
    )
    return Garment(mesh, RestShape(waistband(mesh.vertices, top, wearer.axis_z, waist_reduction=waist_reduction)))
