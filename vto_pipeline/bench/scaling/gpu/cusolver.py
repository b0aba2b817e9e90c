"""The sparse Cholesky factorisation of NVIDIA's cuSOLVER, in the order of elimination of our own.

The functions are those of `cusolverSp_LOWLEVEL_PREVIEW.h`, the only ones that keep analysis, factor and solution apart.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from vto_pipeline.errors import ComputationError, MissingDependencyError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix, to_scipy
from vto_pipeline.numerics.linear.elimination_tree import dissection

_LIBRARY = "libcusolver.so.12"
_RUNS = 3


def cusolver_cholesky(matrix: BlockMatrix, right: FloatArray) -> tuple[FloatArray, dict[str, float]]:
    """Return the solution of A x = right, shape (N, 3), and the times of analysis, factorisation and solution [s].

    Raises:
        ComputationError: one of its functions fails.
        MissingDependencyError: no cuSOLVER with a sparse Cholesky factorisation.
    """
    import cupy
    from cupyx.cusparse import MatDescriptor

    order = np.asarray(dissection(matrix.starts, matrix.columns))
    scalars = (3 * order[:, None] + np.arange(3)).ravel()
    whole = to_scipy(matrix).tocsr()[scalars][:, scalars].tocsr()
    whole.sort_indices()
    count, entries = whole.shape[0], whole.nnz
    values, starts, columns = (cupy.asarray(each) for each in (whole.data, whole.indptr, whole.indices))
    given, x = cupy.asarray(right.ravel()[scalars]), cupy.empty(count)
    call = _calls()
    handle, info, described = ctypes.c_void_p(), ctypes.c_void_p(), MatDescriptor.create()
    call("cusolverSpCreate", ctypes.byref(handle))
    call("cusolverSpCreateCsrcholInfo", ctypes.byref(info))
    pattern = (ctypes.c_void_p(described.descriptor),)
    where = (_pointer(starts), _pointer(columns))
    inside, room = ctypes.c_size_t(), ctypes.c_size_t()
    shape, numbers = (handle, count, entries, *pattern), (_pointer(values), *where)
    try:
        analysis = _seconds(lambda: call("cusolverSpXcsrcholAnalysis", *shape, *where, info))
        sizes = (ctypes.byref(inside), ctypes.byref(room))
        call("cusolverSpDcsrcholBufferInfo", *shape, *numbers, info, *sizes)
        buffer = cupy.empty(room.value, np.uint8)
        factor = [
            _seconds(lambda: call("cusolverSpDcsrcholFactor", *shape, *numbers, info, _pointer(buffer)))
            for _ in range(_RUNS)
        ]
        solve = [
            _seconds(
                lambda: call(
                    "cusolverSpDcsrcholSolve", handle, count, _pointer(given), _pointer(x), info, _pointer(buffer)
                )
            )
            for _ in range(_RUNS)
        ]
    finally:
        call("cusolverSpDestroyCsrcholInfo", info)
        call("cusolverSpDestroy", handle)
    solution = np.empty(count)
    solution[scalars] = x.get()
    times = {"analysis_s": analysis, "factor_s": float(np.median(factor)), "solve_s": float(np.median(solve))}
    return solution.reshape(-1, 3), times


def _calls() -> Callable[..., None]:
    """Return how to call one of its functions by name."""
    from cupy_backends.cuda.libs import cusolver  # noqa: F401  # loads the library, wherever it lies

    try:
        library = ctypes.CDLL(_LIBRARY)
    except OSError as error:
        raise MissingDependencyError(f"no {_LIBRARY}: {error}", hint="pip install nvidia-cusolver") from None

    def call(name: str, *arguments: Any) -> None:
        status = getattr(library, name)(*arguments)
        if status != 0:
            raise ComputationError(f"{name} ended with {status}")

    return call


def _pointer(array: Any) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.data.ptr)


def _seconds(run: Callable[[], object]) -> float:
    import cupy

    cupy.cuda.Device().synchronize()
    began = time.perf_counter()
    run()
    cupy.cuda.Device().synchronize()
    return time.perf_counter() - began
