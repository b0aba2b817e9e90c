"""Drag of still air on the triangles of a cloth."""

from __future__ import annotations

from numba import njit

from vto_pipeline.numerics.vector import axpy, cross, dot, load, norm, scale, store, sub


@njit(cache=True, error_model="numpy")
def add_drag(x, v, faces, strength, forces):  # type: ignore[no-untyped-def]
    """Add -½ρc (A/3) |n·v| (n·v) n [N] to each corner of each triangle.

    Newton's quadratic law for a plate; each corner bears a third of the area at its own speed, so that the slope of
    the force in v has no block off the diagonal.

    Args:
        x: Positions [m], shape (V, 3).
        v: Velocities [m/s], shape (V, 3).
        faces: Shape (F, 3).
        strength: ½ρc [kg/m³].
        forces: [N], shape (V, 3), changed in place.
    """
    for t in range(len(faces)):
        normal, load_third = _facet(x, faces, t, strength)
        for k in range(3):
            corner = faces[t, k]
            speed = dot(normal, load(v, corner))
            store(forces, corner, axpy(-load_third * abs(speed) * speed, normal, load(forces, corner)))


@njit(cache=True, error_model="numpy")
def add_drag_rate(x, v, faces, strength, factor, blocks, places):  # type: ignore[no-untyped-def]
    """Add factor times the slope of the drag in v, ½ρc (2A/3) |n·v| n nᵀ, to the diagonal blocks of a matrix.

    Args:
        x, v, faces, strength: See `add_drag`.
        factor: What to multiply by.
        blocks: Shape (B, 3, 3), changed in place.
        places: The diagonal block of each vertex, -1 where it is held, shape (V,).
    """
    for t in range(len(faces)):
        normal, load_third = _facet(x, faces, t, strength)
        for k in range(3):
            place = places[faces[t, k]]
            if place < 0:
                continue
            slope = 2.0 * factor * load_third * abs(dot(normal, load(v, faces[t, k])))
            for i in range(3):
                for j in range(3):
                    blocks[place, i, j] += slope * normal[i] * normal[j]


@njit(cache=True, error_model="numpy")
def _facet(x, faces, t, strength):  # type: ignore[no-untyped-def]
    """Return the unit normal of a triangle and ½ρc A/3 [kg/m]."""
    a = load(x, faces[t, 0])
    double = cross(sub(load(x, faces[t, 1]), a), sub(load(x, faces[t, 2]), a))
    length = norm(double)
    if length == 0.0:
        return double, 0.0
    return scale(1.0 / length, double), strength * length / 6.0
