"""Audit of a finished drape, independent of the solver's forces and collision code.

Triangles are tested exactly (`geometry.intersections`), depths are libigl's distances and winding numbers, and strain,
energy, residual force and the gap of the cloth to itself are worked out anew (`judge`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.judge.crossings import crossings_between, self_crossings
from vto_pipeline.cloth.judge.gap import gaps_within
from vto_pipeline.cloth.judge.residual import ElasticEnergies, judged_residual
from vto_pipeline.cloth.judge.strain import cloth_triangles, gradients, principal_strains, warp_weft_strains
from vto_pipeline.geometry.signed_distance import SurfaceDistance, SurfacePoints
from vto_pipeline.geometry.topology import laid_edge_lengths
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh

_PLACES = 10  # named of each kind of crossing
_NEAR = 5e-3  # m: gaps wider than this are not looked for
_SKIN = 3e-3  # m: the most that cloth keeps from bodies, unless more is asked for

JUST = 1e-3
"""Cloth no farther from what it keeps its skin from than this beyond it may be borne by that [m]."""


def audit(
    mesh: TriangleMesh,
    rest: RestShape,
    body: TriangleMesh | None,
    *,
    settled: bool,
    energy: float,
    residual: float,
    fabric: Fabric | None = None,
    bending: str = "shape_operator",
    friction: float | None = None,
    skin: float | FloatArray = _SKIN,
    pinned: Sequence[int] = (),
) -> dict[str, object]:
    """Return the findings on a draped garment as plain JSON values, independent of run time.

    Args:
        mesh: The garment as draped [m].
        rest: Its rest shape.
        body: What it lies on, if anything.
        settled: Whether the drape came to rest.
        energy: Stored in the cloth, says the solver [J].
        residual: Residual force as a share of weight, rms over the mass, says the solver.
        fabric: What it is made of, where the judge knows its model (`judge.residual.covers_all_energies`); energy and
            force are then judged.
        bending: Its model of bending.
        friction: Against the body; the fabric's own when None.
        skin: Distance that vertices keep from the body, shape (V,) or one for all [m]. A little more may still be
            borne by it; by the cloth itself, within as little more than its thickness.
        pinned: Vertices that were held, or that something else may bear.

    Returns:
        finite, settled, body_intersections and self_intersections (pairs of triangles) and where the first of them are
        [m], penetration_mm (deepest vertex, 0 when none), penetrating_vertices, min_clearance_mm, min_self_gap_mm (None
        above 5 mm), rms_stretch, max_stretch (of edges, relative), rms and max of the strain of warp, weft and shear
        [rad], largest and least principal strain, area_change, energy_j, residual; and with a fabric judged_energy_j,
        judged_residual, over vertices that the cloth itself cannot bear, and judged_residual_left_out, how many it
        left out: held, without mass, or so near to other cloth that this may bear them.
    """
    laid = rest.corners(mesh.faces)
    length, natural = laid_edge_lengths(mesh, mesh.vertices[mesh.faces]), laid_edge_lengths(mesh, laid)
    stretch = np.abs(length[natural > 0] / natural[natural > 0] - 1.0)
    nearest = None if body is None else SurfaceDistance(body).signed(mesh.vertices)
    crossing = self_crossings(mesh)
    touching = np.broadcast_to(skin, len(mesh.vertices)) + JUST
    thick = JUST if fabric is None else fabric.thickness + JUST
    near, gaps = gaps_within(mesh.vertices, rest.positions, mesh.faces, max(_NEAR, thick))
    gap = 0.0 if len(crossing) else float(gaps.min(initial=np.inf))
    found: dict[str, object] = {
        "finite": bool(np.isfinite(mesh.vertices).all()),
        "settled": settled,
        **_against_body(mesh, body, nearest),
        "self_intersections": len(crossing),
        "self_intersection_places": spread_places(mesh, crossing[:, 0]),
        "min_self_gap_mm": 1e3 * gap if gap < _NEAR else None,
        "rms_stretch": float(np.sqrt(np.mean(stretch**2))),
        "max_stretch": float(stretch.max()),
        **_strains(mesh, rest),
        "area_change": float(_area(mesh.vertices[mesh.faces]) / _area(laid) - 1.0),
        "energy_j": energy,
        "residual": residual,
    }
    if fabric is not None:
        weave = ElasticEnergies(mesh, rest, fabric, bending)
        free = np.ones(len(mesh.vertices), np.bool_)
        free[list(pinned)] = False
        free[mesh.faces[near[gaps < thick]]] = False
        free &= weave.mass > 0.0
        mu = fabric.friction if friction is None else friction
        found["judged_energy_j"] = weave.energy(mesh.vertices)
        found["judged_residual_left_out"] = int((~free).sum())
        found["judged_residual"] = judged_residual(
            weave, mesh.vertices, body, nearest, friction=mu, touching=touching, free=free
        )
    return found


def _against_body(mesh: TriangleMesh, body: TriangleMesh | None, nearest: SurfacePoints | None) -> dict[str, object]:
    if body is None or nearest is None:
        return {
            "body_intersections": 0,
            "body_intersection_places": [],
            "penetration_mm": 0.0,
            "penetrating_vertices": 0,
            "min_clearance_mm": None,
        }
    clearance = nearest.distance
    crossing = crossings_between(mesh, body)
    return {
        "body_intersections": len(crossing),
        "body_intersection_places": spread_places(mesh, crossing[:, 0]),
        "penetration_mm": float(1e3 * max(0.0, -clearance.min())),
        "penetrating_vertices": int((clearance < 0.0).sum()),
        "min_clearance_mm": float(1e3 * clearance.min()),
    }


def _strains(mesh: TriangleMesh, rest: RestShape) -> dict[str, object]:
    laid = cloth_triangles(rest.corners(mesh.faces))
    gradient = gradients(mesh.vertices, mesh.faces, laid)
    share = laid.area / laid.area.sum()
    found: dict[str, object] = {}
    for name, strain in zip(("warp_strain", "weft_strain", "shear_rad"), warp_weft_strains(gradient).T, strict=True):
        found[f"rms_{name}"] = float(np.sqrt(np.sum(share * strain**2)))
        found[f"max_{name}"] = float(np.abs(strain).max())
    principal = principal_strains(gradient)
    return {**found, "largest_strain": float(principal.max()), "least_strain": float(principal.min())}


def spread_places(mesh: TriangleMesh, faces: NDArray[np.int32]) -> list[list[float]]:
    """Return the middle of some of these faces, spread over them [m]."""
    chosen = np.unique(faces)
    chosen = chosen[np.linspace(0, len(chosen) - 1, min(_PLACES, len(chosen))).astype(int)]
    return [[float(x) for x in middle] for middle in mesh.vertices[mesh.faces[chosen]].mean(axis=1)]


def _area(corners: FloatArray) -> float:
    double = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(0.5 * np.linalg.norm(double, axis=1).sum())
