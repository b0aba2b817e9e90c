"""Puts this folder on the import path, so that tests of several rooms can share a scene; threads as `vto` has them."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its sums depend on the thread count

import numba

import vto_pipeline.numerics  # noqa: F401  # Numba's thread pool must be loaded before Open3D brings an older one


def pytest_configure():
    """Share the cores among the workers of pytest-xdist, if there are any."""
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    numba.set_num_threads(max(1, numba.get_num_threads() // workers))
