"""What a first run costs: `make first-run` clocks `make demo` and `make test` in a fresh clone."""

from __future__ import annotations

import argparse
import platform
from collections.abc import Iterator
from pathlib import Path

from vto_pipeline.bench.bench import Row
from vto_pipeline.bench.machine import this_machine
from vto_pipeline.bench.provenance import provenance
from vto_pipeline.io.documents import write_json

_MADE = (".venv", "runs", "vto_pipeline/__pycache__")  # the last holds the compiled kernels
_BLOCK = 512  # bytes that st_blocks counts


def main() -> None:
    """Read the command line and write the results file of this system."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.first_run", description=__doc__)
    parser.add_argument("--demo", type=float, required=True, metavar="SECONDS", help="of `make demo`")
    parser.add_argument("--test", type=float, metavar="SECONDS", help="of `make test` after it")
    parser.add_argument("--results", type=Path, default=Path("docs/results"), metavar="DIR")
    arguments = parser.parse_args()
    system, identity = _system()
    disk_gb = sum(_occupied(Path(name)) for name in _MADE) / 1e9
    rows = [Row(system, "make demo", {}, 0, arguments.demo, {"disk_gb": disk_gb})]
    if arguments.test is not None:
        rows.append(Row(system, "make test", {}, 0, arguments.test, {}))
    document = {
        "bench": "first_run",
        "quick": False,
        **provenance("make first-run"),
        "machine": this_machine(),
        "rows": [row.as_json() for row in rows],
        "fronts": "an installation, not an error that time buys",
    }
    write_json(arguments.results / f"first_run_{identity}.json", document)


def _system() -> tuple[str, str]:
    """Return the names the system gives itself: "Debian GNU/Linux 12 (bookworm)" and "debian_12"."""
    try:
        said = platform.freedesktop_os_release()
    except OSError:
        return platform.platform(), platform.system().lower()
    return said["PRETTY_NAME"], f"{said['ID']}_{said.get('VERSION_ID', '')}".replace(".", "_")


def _occupied(top: Path) -> int:
    """Return the bytes that a folder takes on the disk."""

    def sizes() -> Iterator[int]:
        for path in top.rglob("*"):
            if not path.is_symlink() and path.is_file():
                yield path.stat().st_blocks * _BLOCK

    return sum(sizes())


if __name__ == "__main__":
    main()
