"""How far each vertex of cloth keeps from the body.

Contacts are held at the vertices. Between them a triangle can still cut the body, where that is sharp or the cloth is
stretched to triangles of several times their size. There its vertices keep farther off.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_THICKEN = 1e-3  # m an attempt at least,
_FASTER = 0.15  # and this share of the skin
_DRAPED = 4.0  # skins: what lies farther off than this hangs free
_ROOMY = 0.75  # of its skin that a vertex must have about it on all sides


def draped_skin(cloth: TriangleMesh, body: TriangleMesh, skin: float) -> FloatArray:
    """Return how far each vertex keeps off, so that cloth that lies clear of the body stays clear [m], shape (V,).

    A drape lifts cloth whose triangles cut the body. Let down to the skin again, they would cut it at once: those keep
    the distance that they have.

    Args:
        cloth: As it was draped.
        body: As it was draped on.
        skin: Distance to keep elsewhere [m].
    """
    found = SurfaceDistance(body).signed(cloth.vertices)
    keeps, places = np.full(len(cloth.vertices), skin), cloth.vertices.copy()
    lies = (found.distance > skin) & (found.distance < _DRAPED * skin)
    share = skin / found.distance[lies, None]
    places[lies] = found.point[lies] + share * (cloth.vertices - found.point)[lies]
    while lies.any():
        cutting = intersecting_faces(TriangleMesh(places, cloth.faces), body)[:, 0]
        lifted = np.zeros(len(lies), np.bool_)
        lifted[cloth.faces[cutting]] = True
        lifted &= lies
        if not lifted.any():
            break
        places[lifted], keeps[lifted] = cloth.vertices[lifted], found.distance[lifted]
        lies &= ~lifted
    return keeps


def thickened(skin: FloatArray, about: IntArray, positions: FloatArray, body: TriangleMesh) -> FloatArray:
    """Return a thicker skin, as far as there is room for it [m], shape (V,).

    In a fold of the body, cloth that keeps farther off one side is pressed into the other.

    Args:
        skin: Before [m], shape (V,).
        about: Vertices to thicken, shape (N,).
        positions: Of all vertices [m], shape (V, 3).
        body: Where it is.
    """
    thicker, surface = skin.copy(), SurfaceDistance(body)
    wanted = skin[about] + np.maximum(_THICKEN, _FASTER * skin[about])
    found = surface.signed(positions[about])
    way = positions[about] - found.point
    outwards = way / np.where(found.distance == 0.0, np.inf, found.distance)[:, None]
    there = found.point + wanted[:, None] * outwards
    roomy = surface.signed(there).distance > _ROOMY * wanted
    thicker[about[roomy]] = wanted[roomy]
    return thicker
