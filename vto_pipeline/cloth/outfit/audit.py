"""Independent audit of several garments: each by itself, all together, and their order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.judge.audit import JUST, audit, spread_places
from vto_pipeline.cloth.judge.crossings import crossings_between
from vto_pipeline.cloth.judge.gap import gaps_within
from vto_pipeline.cloth.judge.limits import warn_beyond_limits
from vto_pipeline.cloth.judge.order import outside_outer_garment
from vto_pipeline.cloth.judge.residual import covers_all_energies
from vto_pipeline.cloth.judge.too_small import warn_if_too_small
from vto_pipeline.cloth.outfit.combined_cloth import CombinedCloth
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.outfit import Layer

_NEAR = 5e-3  # m: wider gaps between layers are not looked for
_PLACES = 10  # named of two garments


def audit_outfit(
    layers: Sequence[Layer],
    joined: CombinedCloth,
    body: TriangleMesh,
    config: DrapeConfig,
    *,
    settled: bool,
    residual: float,
    skin: FloatArray,
    job: Job,
) -> dict[str, Any]:
    """Return the findings on garments worn in layers as plain JSON values.

    Args:
        layers: As draped, inner first.
        joined: The same as one cloth.
        body: What they lie on [m].
        config: How they were modelled.
        settled: Whether they came to rest, all together.
        residual: Residual force of all as a share of weight, rms over the mass, says the solver.
        skin: Distance that the vertices of `joined` keep from the body [m], shape (V,).
        job: Warned of garments that are too small, and of layers out of order.

    Returns:
        Under "layers" what `audit.audit`, `too_small.warn_if_too_small` and `limits.warn_beyond_limits` find of each
        garment, a vertex that another garment may bear counted as held. Of all: the sum of their crossings, and the
        worst of what else is in its findings; layer_intersections (pairs of triangles of two garments),
        min_layer_gap_mm (None above 5 mm), out_of_order_vertices (of inner garments, outside an outer one), the
        largest out_of_order_share of a garment's, order_kept (there are none), and the places of these [m].
    """
    x = np.vstack([layer.garment.mesh.vertices for layer in layers])
    touching = float(skin.min()) + JUST
    near, gaps = _between(layers, x, joined, max(_NEAR, touching))
    borne = np.unique(joined.mesh.faces[near[gaps < touching]])
    found: dict[str, dict[str, Any]] = {}
    for layer, model, span in zip(layers, joined.models, joined.vertices, strict=True):
        mesh, rest, told = layer.garment.mesh, layer.garment.rest, Job()
        found[layer.name] = {
            "mode": rest.worn_as,
            **audit(
                mesh,
                rest,
                body,
                settled=settled,
                energy=elastic_energy(model, x),
                residual=residual,
                fabric=layer.fabric if covers_all_energies(config) else None,
                bending=config.bending,
                friction=config.friction,
                skin=skin[span],
                pinned=borne[(borne >= span.start) & (borne < span.stop)] - span.start,
            ),
            **warn_if_too_small(mesh, rest, config.stretch_limit, told),
            **warn_beyond_limits(mesh, rest, layer.fabric, told),
        }
        job.warnings += [f"{layer.name}: {text}" for text in told.warnings]
        job.notes += [f"{layer.name}: {text}" for text in told.notes]
    crossing = [
        (inner.garment.mesh, crossings_between(inner.garment.mesh, outer.garment.mesh)[:, 0])
        for inner, outer in combinations(layers, 2)
    ]
    count = sum(len(faces) for _, faces in crossing)
    gap = 0.0 if count else float(gaps.min(initial=np.inf))
    return {
        **_together([found[layer.name] for layer in layers]),
        "residual": residual,
        "layer_intersections": count,
        "layer_intersection_places": [place for mesh, faces in crossing for place in spread_places(mesh, faces)],
        "min_layer_gap_mm": 1e3 * gap if gap < _NEAR else None,
        **_order(layers, body, job),
        "layers": found,
    }


def _between(
    layers: Sequence[Layer], x: FloatArray, joined: CombinedCloth, within: float
) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the pairs of faces of two garments that are this near, and their distances [m]."""
    near, gaps = gaps_within(x, joined.rest.positions, joined.mesh.faces, within)
    of_face = np.repeat(np.arange(len(layers)), [len(layer.garment.mesh.faces) for layer in layers])
    apart = of_face[near[:, 0]] != of_face[near[:, 1]]
    return near[apart], gaps[apart]


def _together(each: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return what the garments' findings are of all of them."""
    kinds: dict[Callable[[Any], Any], tuple[str, ...]] = {
        all: ("finite", "settled"),
        any: ("too_small",),
        sum: ("body_intersections", "self_intersections", "penetrating_vertices", "energy_j"),
        max: ("penetration_mm", "max_stretch", "largest_strain"),
        min: ("min_clearance_mm",),
    }
    found = {name: kind([one[name] for one in each]) for kind, names in kinds.items() for name in names}
    for name in ("body_intersection_places", "self_intersection_places"):
        found[name] = [place for one in each for place in one[name]]
    return found


def _order(layers: Sequence[Layer], body: TriangleMesh, job: Job) -> dict[str, Any]:
    """Return which vertices of inner garments lie outside outer ones, and where."""
    count, share, where = 0, 0.0, []
    for inner, outer in combinations(layers, 2):
        mesh = inner.garment.mesh
        beyond = outside_outer_garment(mesh, outer.garment.mesh, body)
        if len(beyond):
            count, share = count + len(beyond), max(share, len(beyond) / len(mesh.vertices))
            chosen = beyond[np.linspace(0, len(beyond) - 1, min(_PLACES, len(beyond))).astype(int)]
            where += [[float(part) for part in point] for point in mesh.vertices[chosen]]
            job.warn(f"{len(beyond)} of {len(mesh.vertices)} vertices of {inner.name} lie outside {outer.name}")
    found = {"out_of_order_vertices": count, "out_of_order_share": share, "out_of_order_places": where}
    return {**found, "order_kept": count == 0}
