"""MakeHuman's base mesh, targets and rig from the user's installation: decimetres, sparse offsets, JSON.

A folder holds base.obj and, if wanted, targets.yaml (file of a target -> its share, 0 to 1 as a rule), one rig
(rig*.json or *.mhskel) and its weights (weights*.json or *.mhw).
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.documents import load_yaml, read_json
from vto_pipeline.io.files import check_file, listed
from vto_pipeline.io.formats.obj import parse_obj
from vto_pipeline.io.text_numbers import parse_rows, read_lines
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.units import LENGTH_M

BASE = "base.obj"
_BODY_GROUP = "body"
_LIMIT_BYTES = 100_000_000
_SHARES = (-5.0, 5.0)


def parse_makehuman(name: str) -> Arrays:
    """Read a MakeHuman body at rest.

    Args:
        name: Path of the folder.

    Returns:
        vertices [m], faces; with a rig and weights also joints, parents, weights, joint_names.

    Raises:
        InputError, FormatError: a file is missing or breaks its format, or a target names a vertex that is not there.
    """
    folder = Path(name)
    base = check_file(folder / BASE, {".obj"}, _LIMIT_BYTES)
    points = parse_obj(str(base))["vertices"] * LENGTH_M["dm"]
    groups = parse_groups(base, len(points))
    faces = groups.get(_BODY_GROUP)
    if faces is None:
        raise FormatError(f"no group {_BODY_GROUP!r}; found {', '.join(list(groups)[:8])}", where=str(base))
    for target, share in _shares(folder).items():
        place, offset = parse_target(folder / target, len(points))
        np.add.at(points, place, share * LENGTH_M["dm"] * offset)
    used = np.unique(faces)
    arrays: Arrays = {"vertices": points[used], "faces": np.searchsorted(used, faces)}
    rig, weights = (_one(folder, kinds) for kinds in (("rig", ".mhskel"), ("weights", ".mhw")))
    if rig is not None and weights is not None:
        arrays |= _skin(rig, weights, points, groups, used)
    return arrays


def parse_groups(path: Path, count: int) -> dict[str, NDArray[np.int64]]:
    """Return the triangles of each group of an OBJ file, shape (F, 3).

    Args:
        path: The file.
        count: Its vertices.

    Raises:
        FormatError: a corner is none of its vertices.
    """
    found: dict[str, list[tuple[int, int, int]]] = {}
    group = ""
    for number, line in enumerate(read_lines(path), start=1):
        words = line.split()
        if words[:1] == ["g"]:
            group = " ".join(words[1:])
        elif words[:1] == ["f"]:
            try:
                corner = [int(word.split("/", 1)[0]) - 1 for word in words[1:]]
            except ValueError:
                corner = [-1]
            if not all(0 <= k < count for k in corner):
                raise FormatError(f"not numbers 1..{count}: {words[1:]}"[:200], where=f"{path}, line {number}")
            triangles = ((corner[0], corner[k], corner[k + 1]) for k in range(1, len(corner) - 1))
            found.setdefault(group, []).extend(triangles)
    return {name: np.array(faces, dtype=np.int64).reshape(-1, 3) for name, faces in found.items()}


def _shares(folder: Path) -> dict[str, float]:
    path = folder / "targets.yaml"
    if not path.exists():
        return {}
    data = load_yaml(path).data
    if not isinstance(data, Mapping):
        raise FormatError("expected lines of the form TARGET_FILE: SHARE", where=str(path))
    for target, share in data.items():
        inside = (folder / str(target)).resolve().is_relative_to(folder.resolve())
        if not inside or isinstance(share, bool) or not isinstance(share, int | float):
            raise FormatError(f"{target}: {share!r}; expected a file in this folder and a number", where=str(path))
        if not _SHARES[0] <= share <= _SHARES[1]:
            raise FormatError(f"{target}: the share {share} is outside {_SHARES[0]:g}..{_SHARES[1]:g}", where=str(path))
    return {str(target): float(share) for target, share in data.items()}


def parse_target(path: Path, count: int) -> tuple[NDArray[np.int64], FloatArray]:
    """Return vertices (N,) and offsets (N, 3) [dm] of a target.

    Args:
        path: A .target file, gzipped or not.
        count: Vertices of the base mesh.

    Raises:
        InputError, FormatError: no such file, or other than lines of a vertex and three numbers.
    """
    check_file(path, {".target", ".gz"}, _LIMIT_BYTES)
    try:
        if path.suffix == ".gz":
            with gzip.open(path) as stream:
                data = stream.read(_LIMIT_BYTES)
        else:
            data = path.read_bytes()
    except (OSError, EOFError, zlib.error) as e:
        raise FormatError(f"not a gzipped target: {e}", where=str(path)) from None
    lines = data.decode("utf-8", errors="replace").splitlines()
    kept = [(text, k) for k, text in enumerate(lines, start=1) if text.strip() and not text.lstrip().startswith("#")]
    # a target without a line is the mean itself: MakeHuman's own data hold such ones
    rows = parse_rows([text for text, _ in kept], [k for _, k in kept], path) if kept else np.zeros((0, 4))
    place = rows[:, 0].astype(np.int64) if rows.shape[1:] == (4,) and np.isfinite(rows).all() else None
    if place is None or (place != rows[:, 0]).any() or (place < 0).any() or (place >= count).any():
        raise FormatError(f"expected lines of a vertex number (0..{count - 1}) and three offsets", where=str(path))
    return place, rows[:, 1:]


def _one(folder: Path, kinds: tuple[str, str]) -> Path | None:
    start, suffix = kinds
    found = [p for p in listed(folder, {".json", suffix}) if p.suffix == suffix or p.name.startswith(start)]
    if len(found) > 1:
        raise FormatError(f"{len(found)} files of {start}: {', '.join(p.name for p in found)}", where=str(folder))
    return found[0] if found else None


def _skin(
    rig: Path, weights: Path, points: FloatArray, groups: Mapping[str, NDArray[np.int64]], used: NDArray[np.int64]
) -> Arrays:
    """Joints, parents and weights; bones come after their parents."""
    try:
        document = read_json(rig)
        bones: dict[str, Any] = dict(document["bones"])
        names: list[str] = []
        while len(names) < len(bones):
            ready = [b for b in bones if b not in names and (not bones[b].get("parent") or bones[b]["parent"] in names)]
            if not ready:
                raise FormatError("a bone's parent is missing, or the bones form a loop", where=str(rig))
            names += ready
        joints = np.array([_head(bones[b]["head"], document, points, groups) for b in names])
        parents = [names.index(bones[b]["parent"]) if bones[b].get("parent") else -1 for b in names]
        shares = np.zeros((len(points), len(names)))
        for bone, pairs in read_json(weights)["weights"].items():
            if bone in names and len(pairs):
                table = np.array(pairs, dtype=np.float64).reshape(-1, 2)
                shares[table[:, 0].astype(np.int64), names.index(bone)] = table[:, 1]
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as e:
        raise FormatError(f"not a rig with its weights: {e!r}", where=f"{rig}, {weights.name}") from None
    held = shares[used]
    if not np.isfinite(held).all() or (held < 0).any() or (held.sum(axis=1) <= 0).any():
        raise FormatError("a vertex of the body has no weights, or a negative one", where=str(weights))
    return {
        "joints": joints,
        "parents": np.array(parents, dtype=np.int64),
        "weights": held / held.sum(axis=1, keepdims=True),
        "joint_names": np.array(names, dtype=np.str_),
    }


def _head(
    head: Any, document: Mapping[str, Any], points: FloatArray, groups: Mapping[str, NDArray[np.int64]]
) -> FloatArray:
    """Where a bone begins: the middle of a helper cube or of some vertices, by name (mhskel) or by strategy (MPFB)."""
    if isinstance(head, str):
        place = np.array(document["joints"][head], dtype=np.int64)
    elif head["strategy"] == "CUBE":
        place = np.unique(groups[head["cube_name"]])
    elif head["strategy"] == "VERTEX":
        place = np.array([head["vertex_index"]], dtype=np.int64)
    else:
        place = np.array(head["vertex_indices"], dtype=np.int64)
    middle: FloatArray = points[place].mean(axis=0)
    return middle
