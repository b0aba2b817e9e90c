"""Provenance of results: the command, the date and the commit."""

from __future__ import annotations

import subprocess
from datetime import datetime, timezone
from pathlib import Path

import vto_pipeline

_PATIENCE_S = 10.0
_MEASURED = ("vto_pipeline", "pyproject.toml", "sample_data", "configs")
"""What a figure depends on; a change elsewhere, in a page say, leaves it as it is."""


def provenance(command: str) -> dict[str, str | None]:
    """Return what the head of a results file says beside the machine.

    Args:
        command: What a reader types to measure the same again.

    Returns:
        {"command", "commit", "date" (UTC)}; the commit is None outside a checkout, and ends in "+changes" where the
        code differs from it.
    """
    return {
        "command": command,
        "commit": _commit(Path(vto_pipeline.__file__).parents[1]),
        "date": datetime.now(timezone.utc).date().isoformat(),
    }


def _commit(root: Path) -> str | None:
    known = _git(root, "rev-parse", "--short=12", "HEAD")
    if known is None:
        return None
    return f"{known}+changes" if _git(root, "status", "--porcelain", "--", *_MEASURED) else known


def _git(root: Path, *arguments: str) -> str | None:
    """Return what git prints; None where there is no git, or no checkout."""
    if not (root / ".git").exists():
        return None
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *arguments], capture_output=True, text=True, timeout=_PATIENCE_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
