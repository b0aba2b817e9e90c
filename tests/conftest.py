"""Puts this folder on the import path, so that tests of several rooms can share a scene; threads as `vto` has them.

Workers of pytest-xdist that begin with cloth all compile the same kernels, each for itself. So the files that compile
most of them come first and stay with one worker, and what else needs them comes last.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its sums depend on the thread count

import numba
import pytest

import vto_pipeline.numerics  # noqa: F401  # Numba's thread pool must be loaded before Open3D brings an older one

COMPILE_MOST = tuple(
    f"tests/cloth/test_{name}.py" for name in ("constraints", "identities", "integrators", "methods", "solvers")
)
NEED_THEM = tuple(f"tests/{room}/" for room in ("bench", "cli", "cloth", "stages"))


def pytest_configure(config):
    """Share the cores among the workers of pytest-xdist, if there are any."""
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    numba.set_num_threads(max(1, numba.get_num_threads() // workers))
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False  # workers take files in the order below


def pytest_collection_modifyitems(items):
    """Put what compiles first and what needs it last."""
    items.sort(key=lambda item: 0 if item.nodeid.startswith(COMPILE_MOST) else 1 + item.nodeid.startswith(NEED_THEM))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Let one worker have all files that compile most."""
    from xdist.scheduler import LoadFileScheduling

    class OneCompiles(LoadFileScheduling):
        def _split_scope(self, nodeid):
            return COMPILE_MOST[0] if nodeid.startswith(COMPILE_MOST) else super()._split_scope(nodeid)

    return OneCompiles(config, log) if config.getoption("dist") == "loadfile" else None
