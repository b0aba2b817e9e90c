"""Trousers: the skin of the lower body moved outward, wider towards the ankles, held by their waistband."""

from __future__ import annotations

import numpy as np

from vto_pipeline.bench.samples.garments.tailoring import mesh_garment_field, waistband
from vto_pipeline.bench.samples.garments.wearer import Wearer
from vto_pipeline.bench.samples.solids.primitives import cone, smooth_union
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import Garment, RestShape

_GUSSET = 0.012  # by which the legs part below it [m]


def make_trousers(
    wearer: Wearer,
    edge_mm: float = 12.0,
    *,
    clearance: float = 0.008,
    cuff: float = 0.035,
    waist_reduction: float = 0.08,
) -> Garment:
    """Return trousers that end above the ankle.

    Args:
        wearer: Whom they are cut for.
        edge_mm: Length of their edges [mm].
        clearance: Gap to the body at the waist [m].
        cuff: The same at the ankles [m].
        waist_reduction: By which share the band is narrower than it is worn.
    """
    top, hem = wearer.waist, wearer.ankle + 0.06

    def gap(heights: FloatArray) -> FloatArray:
        return np.interp(
            heights, [hem, wearer.knee, wearer.crotch, top], [cuff, 0.7 * cuff, 2.0 * clearance, clearance]
        )

    # between the thighs the two legs would meet in a crease: a gusset fills it down to where they part
    inner = np.array([0.0, wearer.crotch, wearer.axis_z])
    below = inner - np.outer(np.arange(0.0, wearer.crotch - wearer.knee, 0.005), [0.0, 1.0, 0.0])
    parted = np.argmax(wearer.distance(below) > gap(below[:, 1]) + _GUSSET)

    def field(points: FloatArray) -> FloatArray:
        gusset = cone(points, inner, below[max(int(parted), 1)], (2.0 * clearance, 2.0 * clearance))
        return smooth_union(wearer.distance(points) - gap(points[:, 1]), gusset, 3.0 * _GUSSET)

    reach = np.array([0.35, 0.0, 0.35])
    mesh = mesh_garment_field(
        field,
        np.array([0.0, hem, 0.0]) - reach,
        np.array([0.0, top, 0.0]) + reach,
        [lambda points: top - points[:, 1], lambda points: points[:, 1] - hem],
        edge_mm,
    )
    return Garment(mesh, RestShape(waistband(mesh.vertices, top, wearer.axis_z, waist_reduction=waist_reduction)))
