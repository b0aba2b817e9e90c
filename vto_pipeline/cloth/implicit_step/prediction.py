"""Free-flight positions x̃ of a step."""

from __future__ import annotations

from numba import njit, prange

from vto_pipeline.numerics.vector import add, axpy, load, scale, store

_CHUNK = 512  # vertices a thread takes at a time


@njit(cache=True, error_model="numpy")
def predict(x, v, start, inverse_mass, fall, h, keep, threaded):
    """Write x to start, and x + h keep (v + fall) to x.

    Args:
        x: Positions [m], shape (V, 3).
        v: Velocities [m/s], shape (V, 3).
        start: Shape (V, 3).
        inverse_mass: [1/kg], shape (V,); zero holds a vertex.
        fall: Speed gained by gravity, three numbers [m/s].
        h: Step [s].
        keep: Share of the speed that damping leaves.
        threaded: Whether to use threads.
    """
    if threaded:
        _predict_parallel(x, v, start, inverse_mass, fall, h, keep)
    else:
        _predict(x, v, start, inverse_mass, fall, h, keep, 0, len(x))


@njit(cache=True, error_model="numpy", parallel=True)
def _predict_parallel(x, v, start, inverse_mass, fall, h, keep):
    for chunk in prange((len(x) + _CHUNK - 1) // _CHUNK):
        _predict(x, v, start, inverse_mass, fall, h, keep, _CHUNK * chunk, min(len(x), _CHUNK * chunk + _CHUNK))


@njit(cache=True, error_model="numpy")
def _predict(x, v, start, inverse_mass, fall, h, keep, first, last):
    for i in range(first, last):
        store(start, i, load(x, i))
        if inverse_mass[i] > 0.0:
            store(x, i, axpy(h, add(scale(keep, load(v, i)), fall), load(x, i)))
