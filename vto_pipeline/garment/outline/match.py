"""The edge in the picture that belongs to each point of an outline.

Harris and Stennett 1990 ("RAPID, a video rate object tracker"); Drummond and Cipolla 2002.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def nearest_edges(gradient, pixel, outward, reach, half):  # type: ignore[no-untyped-def]  # typed by Numba
    """Look for an edge along the normal of each point of an outline.

    Of the edges within reach that run along the outline, that with the best product of strength and nearness counts.

    Args:
        gradient: Of the picture, shape (H, W, 2).
        pixel: Points, shape (N, 2).
        outward: Unit normals, shape (N, 2).
        reach: How far to look [px].
        half: Gradient of an edge that counts half.

    Returns:
        How far outward the edge lies [px], shape (N,); its strength between 0 and 1, 0 where there is none, shape (N,).
    """
    height, width, _ = gradient.shape
    steps = int(np.ceil(reach))
    count = 2 * steps + 1
    offset, strength = np.zeros(len(pixel)), np.zeros(len(pixel))
    profile = np.zeros(count)
    for n in range(len(pixel)):
        nx, ny = outward[n]
        for k in range(count):
            u, v = pixel[n, 0] + (k - steps) * nx, pixel[n, 1] + (k - steps) * ny
            profile[k] = 0.0
            if not (0 <= u < width - 1 and 0 <= v < height - 1):
                continue
            i, j = int(v), int(u)
            p, q = v - i, u - j
            gx, gy = 0.0, 0.0
            for di in range(2):
                for dj in range(2):
                    w = (p if di else 1 - p) * (q if dj else 1 - q)
                    gx += w * gradient[i + di, j + dj, 0]
                    gy += w * gradient[i + di, j + dj, 1]
            along = abs(gx * nx + gy * ny)
            size = np.hypot(gx, gy)
            if size > 0:
                profile[k] = along * (along / size) ** 2
        best = 0.0
        for k in range(1, count - 1):
            here = profile[k]
            if here <= 0 or here < profile[k - 1] or here <= profile[k + 1]:
                continue
            bend = profile[k - 1] - 2 * here + profile[k + 1]
            shift = 0.5 * (profile[k - 1] - profile[k + 1]) / bend if bend < 0 else 0.0
            away = (k - steps) + shift
            near = 1.0 - (away / reach) ** 2
            if near <= 0:
                continue
            strong = here / (here + half)
            if strong * near > best:
                best = strong * near
                offset[n], strength[n] = away, strong
    return offset, strength
