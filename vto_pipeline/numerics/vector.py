"""Three-vectors as tuples of floats, which live in registers inside a Numba kernel."""

from __future__ import annotations

from math import sqrt

from numba import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def load(array, i):
    """Return row i of an (N, 3) array."""
    return array[i, 0], array[i, 1], array[i, 2]


@njit(cache=True, error_model="numpy", forceinline=True)
def load_at(array, i, j):
    """Return row j of array[i], of an (N, M, 3) array. A view array[i] would count references: slow in a loop."""
    return array[i, j, 0], array[i, j, 1], array[i, j, 2]


@njit(cache=True, error_model="numpy", forceinline=True)
def store(array, i, a):
    """Write a into row i of an (N, 3) array."""
    array[i, 0], array[i, 1], array[i, 2] = a


@njit(cache=True, error_model="numpy", forceinline=True)
def store_at(array, i, j, a):
    """Write a into row j of array[i], of an (N, M, 3) array, as `load_at` reads it."""
    array[i, j, 0], array[i, j, 1], array[i, j, 2] = a


@njit(cache=True, error_model="numpy", forceinline=True)
def add(a, b):
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(cache=True, error_model="numpy", forceinline=True)
def sub(a, b):
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, error_model="numpy", forceinline=True)
def scale(s, a):
    """Return s a."""
    return s * a[0], s * a[1], s * a[2]


@njit(cache=True, error_model="numpy", forceinline=True)
def axpy(s, a, b):
    """Return s a + b."""
    return s * a[0] + b[0], s * a[1] + b[1], s * a[2] + b[2]


@njit(cache=True, error_model="numpy", forceinline=True)
def dot(a, b):
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy", forceinline=True)
def cross(a, b):
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy", forceinline=True)
def norm(a):
    """Return the length."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@njit(cache=True, error_model="numpy", forceinline=True)
def unit(a):
    """Return a / |a|, or zero for the zero vector."""
    length = norm(a)
    if length == 0.0:
        return 0.0, 0.0, 0.0
    return a[0] / length, a[1] / length, a[2] / length
