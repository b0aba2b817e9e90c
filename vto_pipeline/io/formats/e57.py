"""E57 (ASTM E2807): all scans of a file in one frame, read by pye57."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.formats.polygons import CUT_OFF

_SIGNATURE = b"ASTM-E57"
_POINTS = 100_000_000
_AXES = ("cartesianX", "cartesianY", "cartesianZ")
_COLORS = ("colorRed", "colorGreen", "colorBlue")


def parse_e57(name: str) -> Arrays:
    """Read an E57 file; points that a scan marks as invalid are dropped.

    Args:
        name: Path of the file.

    Returns:
        vertices (N, 3) [m]; colors (N, 3) uint8, where every scan has them; notes; unit, "m", as the standard demands.

    Raises:
        FormatError: the file breaks the format.
    """
    import pye57
    from pye57.libe57 import E57Exception

    path = Path(name)
    with path.open("rb") as stream:
        if stream.read(len(_SIGNATURE)) != _SIGNATURE:
            raise FormatError("not an E57 file: no ASTM-E57 at its begin", where=str(path))
    try:
        with pye57.E57(str(path)) as opened:
            counts = [opened.get_header(i).point_count for i in range(opened.scan_count)]
            if not 1 <= sum(counts) <= _POINTS:
                raise FormatError(f"{sum(counts)} points; 1 to {_POINTS} can be read", where=str(path))
            scans = [
                opened.read_scan(i, colors=True, ignore_missing_fields=True, transform=True)
                for i, count in enumerate(counts)
                if count > 0
            ]
    except (E57Exception, ValueError, KeyError) as e:
        raise FormatError(f"pye57 cannot read it: {str(e).splitlines()[0]}", where=str(path), hint=CUT_OFF) from None
    arrays: Arrays = {"vertices": _stacked(scans, _AXES, np.float64), "unit": np.array("m")}
    if all(set(_COLORS) <= set(scan) for scan in scans):
        arrays["colors"] = _stacked(scans, _COLORS, np.uint8)
    dropped = sum(counts) - len(arrays["vertices"])
    notes = [f"{len(scans)} scans"] if len(scans) > 1 else []
    notes += [f"dropped {dropped} points without a reading"] if dropped else []
    return {**arrays, "notes": np.array(notes, dtype=np.str_)}


def _stacked(scans: list[dict[str, np.ndarray]], columns: tuple[str, ...], kind: type) -> np.ndarray:
    return np.concatenate([np.stack([scan[name] for name in columns], axis=1) for scan in scans]).astype(kind)
