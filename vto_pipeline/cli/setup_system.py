"""System packages needed before the installation, and the commands that install them.

Runs as a plain file under any Python from 3.10, before anything is installed: standard library only.

    python3 vto_pipeline/cli/setup_system.py .venv     install what is missing, make the virtual environment
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

LIBRARIES = {
    "libgl1": "libGL.so.1",
    "libegl1": "libEGL.so.1",
    "libx11-6": "libX11.so.6",
    "libusb-1.0-0": "libusb-1.0.so.0",
    "libudev1": "libudev.so.1",
    "libidn2-0": "libidn2.so.0",
    "libgomp1": "libgomp.so.1",
}
"""Package of Debian and Ubuntu -> the library Open3D loads from it."""

OLDEST = (3, 10)
"""Python that the package needs."""


def missing_libraries() -> list[str]:
    """Packages whose library cannot be loaded; none on systems other than Linux."""
    return [package for package, name in LIBRARIES.items() if sys.platform == "linux" and not _loads(name)]


def missing_packages() -> list[str]:
    """As `missing_libraries`, and what `python -m venv` needs."""
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    return missing_libraries() + ([] if importlib.util.find_spec("ensurepip") else [f"{version}-venv"])


def install_command(packages: list[str]) -> str:
    """Return the command that a user would type."""
    return f"sudo apt-get install -y --no-install-recommends {' '.join(packages)}"


def install(packages: list[str]) -> None:
    """Install system packages with apt-get, as root or through sudo; where it cannot, end the process and say so."""
    rights = _rights()
    if shutil.which("apt-get") is None or rights is None:
        why = "apt-get is not available" if shutil.which("apt-get") is None else "this needs root, and there is no sudo"
        sys.exit(f"error: system packages are missing, and {why}\n  hint: {install_command(packages)}")
    _say(f"installing system packages: {' '.join(packages)}")
    quiet = [*rights, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-qq"]
    subprocess.run([*quiet, "update"], check=False)  # a stale index may still do
    done = subprocess.run([*quiet, "install", "-y", "--no-install-recommends", *packages], check=False)
    if done.returncode != 0:
        sys.exit(f"error: apt-get failed (exit {done.returncode})\n  hint: {install_command(packages)}")


def make_environment(folder: Path) -> None:
    """Make a virtual environment with pip, unless there is a whole one."""
    python = folder / "bin" / "python"
    if (
        python.exists()
        and subprocess.run([python, "-m", "pip", "--version"], capture_output=True, check=False).returncode == 0
    ):
        return
    _say(f"creating {folder} with Python {sys.version.split()[0]}")
    subprocess.run([sys.executable, "-m", "venv", "--clear", folder], check=True)


def main() -> None:
    """Prepare the system and the virtual environment named on the command line."""
    if sys.version_info < OLDEST:
        problem = f"Python {sys.version.split()[0]} is too old; this needs {'.'.join(map(str, OLDEST))} or later"
        sys.exit(f"error: {problem}\n  hint: make PYTHON=python3.11")
    packages = missing_packages()
    if packages:
        install(packages)
    make_environment(Path(sys.argv[1]))


def _loads(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def _rights() -> list[str] | None:
    """Return the prefix for a command that needs root; None if root is out of reach."""
    if os.geteuid() == 0:
        return []
    if shutil.which("sudo") is None:
        return None
    return ["sudo"] if sys.stdin.isatty() else ["sudo", "-n"]


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")


if __name__ == "__main__":
    main()
