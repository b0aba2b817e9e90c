"""Procedural paints, evaluated where a ray hits: woven print, mottled linen, dull floor."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

# Linear RGB.
INK = np.array([[0.60, 0.055, 0.05], [0.03, 0.13, 0.30], [0.75, 0.48, 0.07], [0.72, 0.70, 0.64], [0.03, 0.22, 0.16]])
CLOTH = np.array([0.50, 0.46, 0.38])
LINEN = np.array([0.52, 0.43, 0.31])
SUIT = np.array([0.10, 0.12, 0.15])
FLOOR = np.array([0.16, 0.16, 0.165])


@njit(cache=True, inline="always")
def _hash(x: int, y: int, z: int, seed: int) -> float:
    """A number in [0, 1) that depends on four integers (after Jenkins' one-at-a-time mixing)."""
    h = np.uint64(x * 73856093) ^ np.uint64(y * 19349663) ^ np.uint64(z * 83492791) ^ np.uint64(seed * 2654435761)
    h = (h ^ (h >> np.uint64(16))) * np.uint64(0x45D9F3B3335B369)
    h = (h ^ (h >> np.uint64(29))) * np.uint64(0x3335B36945D9F3B)
    return float((h >> np.uint64(40)) & np.uint64(0xFFFF)) / 65536.0


@njit(cache=True)
def noise(x: float, y: float, z: float, seed: int) -> float:
    """Value noise in [-1, 1] with a lattice of spacing 1, smooth between lattice points."""
    i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
    u, v, w = x - i, y - j, z - k
    u, v, w = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v), w * w * (3.0 - 2.0 * w)
    total = 0.0
    for corner in range(8):
        a, b, c = corner & 1, (corner >> 1) & 1, (corner >> 2) & 1
        weight = (u if a else 1.0 - u) * (v if b else 1.0 - v) * (w if c else 1.0 - w)
        total += weight * _hash(i + a, j + b, k + c, seed)
    return 2.0 * total - 1.0


@njit(cache=True)
def woven_print(u: float, v: float, out: FloatArray) -> None:
    """Checks with a random woven motif, on cloth coordinates [m]; linear RGB into `out` (3,)."""
    mottle = 1.0 + 0.22 * noise(u / 0.0032, v / 0.0032, 0.5, 1) + 0.18 * noise(u / 0.011, v / 0.011, 0.5, 2)
    mottle += 0.12 * noise(u / 0.045, v / 0.045, 0.5, 3)
    out[:] = CLOTH * mottle
    for period, width, ink, share in ((0.052, 0.014, 1, 0.55), (0.052, 0.003, 0, 0.75), (0.087, 0.005, 4, 0.60)):
        for along in (u, v + 0.013):
            phase = (along / period + 0.37 * ink) % 1.0
            if phase < width / period:
                out[:] = (1.0 - share) * out + share * INK[ink] * mottle
    for layer, cell in enumerate((0.021, 0.009)):
        i, j = int(np.floor(u / cell)), int(np.floor(v / cell))
        if _hash(i, j, layer, 11) < 0.62:
            x = u / cell - i - 0.5 - 0.24 * (_hash(i, j, layer, 12) - 0.5)
            y = v / cell - j - 0.5 - 0.24 * (_hash(i, j, layer, 13) - 0.5)
            stretch = 0.6 + 0.8 * _hash(i, j, layer, 14)
            size = 0.16 + 0.18 * _hash(i, j, layer, 15)
            if abs(x) * stretch + abs(y) / stretch < size:
                ink = int(5.0 * _hash(i, j, layer, 16))
                out[:] = 0.15 * out + 0.85 * INK[ink] * mottle


@njit(cache=True)
def linen(x: float, y: float, z: float, out: FloatArray) -> None:
    """Natural linen, mottled at several scales, as a solid [m]; linear RGB into `out` (3,)."""
    mottle = (
        1.0 + 0.16 * noise(x / 0.0030, y / 0.0030, z / 0.0030, 21) + 0.20 * noise(x / 0.008, y / 0.008, z / 0.008, 22)
    )
    mottle += 0.16 * noise(x / 0.024, y / 0.024, z / 0.024, 23) + 0.12 * noise(x / 0.08, y / 0.08, z / 0.08, 24)
    slub = noise(x / 0.030, y / 0.0022, z / 0.030, 25)
    out[:] = LINEN * mottle * (0.75 if slub > 0.62 else 1.0)


@njit(cache=True)
def speckled_suit(x: float, y: float, z: float, out: FloatArray) -> None:
    """A close-fitting suit with printed speckles, as a solid [m]; linear RGB into `out` (3,)."""
    fine = noise(x / 0.007, y / 0.007, z / 0.007, 41)
    coarse = noise(x / 0.022, y / 0.022, z / 0.022, 42)
    out[:] = SUIT * (1.0 + 0.25 * noise(x / 0.06, y / 0.06, z / 0.06, 43))
    if coarse > 0.30:
        out[:] = INK[int(2.5 + 2.5 * noise(x / 0.05, y / 0.05, z / 0.05, 44))]
    if fine > 0.42:
        out[:] = INK[3]


@njit(cache=True)
def floor(x: float, z: float, out: FloatArray) -> None:
    """A dull floor [m]; linear RGB into `out` (3,)."""
    out[:] = FLOOR * (1.0 + 0.05 * noise(x / 0.05, 0.5, z / 0.05, 31) + 0.03 * noise(x / 0.011, 0.5, z / 0.011, 32))


def cloth_coordinates(mesh: TriangleMesh, around: FloatArray, along: FloatArray, girth: FloatArray) -> FloatArray:
    """Cloth coordinates per triangle corner, unwrapped so that no triangle spans a full turn.

    Args:
        mesh: The cloth.
        around, along: Arc and length at each triangle corner, shape (F, 3) [m].
        girth: Arc of the full turn for each triangle, shape (F,) [m].

    Returns:
        Shape (F, 3, 2) [m].
    """
    turns = np.round((around - around[:, :1]) / girth[:, None])
    return np.stack([around - turns * girth[:, None], along], axis=-1).reshape(len(mesh.faces), 3, 2)
