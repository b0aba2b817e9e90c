"""Wavefront OBJ: vertices, their colours, faces, the texture coordinates of their corners, and materials beside it.

Normals are ignored. Programs add keywords of their own (a simulator its velocities): these lines are skipped, and
counted. Vertices keep the numbering of the file, so that texture seams do not
cut the surface.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.formats.mtl import material_picture
from vto_pipeline.io.formats.polygons import CUT_OFF, fan_triangulation, triangulate_polygons
from vto_pipeline.io.text_numbers import parse_numbers, parse_rows, read_lines
from vto_pipeline.model.arrays import FloatArray, IntArray

_NAMES = """
vn vp o g s mg l p usemtl mtllib usemap maplib bevel c_interp d_interp lod shadow_obj
"""
_IGNORED = frozenset(_NAMES.split())


def parse_obj(name: str) -> Arrays:
    """Read an OBJ file.

    Args:
        name: Path of the file.

    Returns:
        vertices (V, 3); faces (F, 3); colors (V, 3) uint8 and texture (F, 3, 2), where given; where a material has a
        colour or picture, picture (H, W, 3) uint8 and the places there (F, 3, 2); notes.

    Raises:
        FormatError: the file breaks the format.
    """
    path = Path(name)
    lines = _join_continued(read_lines(path))
    words = [line.split("#", 1)[0].split(None, 1) for line in lines]
    keys = np.array([w[0] if w else "" for w in words])
    unknown = ~np.isin(keys, [*_IGNORED, "v", "vt", "f", ""])
    if unknown[-1:].any() and not path.read_bytes().endswith(b"\n"):
        raise FormatError(f"{str(keys[-1])!r} is not an OBJ keyword", where=f"{path}, line {len(keys)}", hint=CUT_OFF)
    is_vertex, is_face = keys == "v", keys == "f"
    if not is_vertex.any() or not is_face.any():
        problem = f"{is_vertex.sum()} vertices and {is_face.sum()} faces; expected a mesh"
        raise FormatError(problem, where=str(path))

    def rest(chosen: np.ndarray) -> tuple[list[str], list[int]]:
        at = np.flatnonzero(chosen)
        return [words[i][1] if len(words[i]) > 1 else "" for i in at], [int(i) + 1 for i in at]

    values = parse_rows(*rest(is_vertex), path)
    if values.shape[1] not in (3, 4, 6, 7):
        raise FormatError(f"vertices have {values.shape[1]} numbers; expected 3, or 6 with a colour", where=str(path))
    arrays: Arrays = {"vertices": values[:, :3]}
    if values.shape[1] >= 6:
        arrays["colors"] = np.clip(np.nan_to_num(values[:, 3:6]) * 255, 0, 255).round().astype(np.uint8)
    is_texture, placed = keys == "vt", None
    face_rows = rest(is_face)
    corners = [row.split() for row in face_rows[0]]
    seen = np.cumsum(is_vertex)[is_face]
    triangles, notes = triangulate_polygons(_polygons(corners, *face_rows, seen, path), path)
    if is_texture.any():
        try:
            placed = _texture(corners, face_rows[1], np.cumsum(is_texture)[is_face], rest(is_texture), path)
            if np.isfinite(placed).all():
                arrays["texture"] = placed
            else:
                notes.append("texture coordinates are ignored: not every corner has one")
        except FormatError as e:  # the shape is whole without them
            notes.append(f"texture coordinates are ignored: {e.problem} ({e.where})")
    try:
        shown = material_picture(path, rest(keys == "mtllib")[0], *_materials(words, keys, corners), placed)
        if shown is not None:
            arrays["picture"], arrays["places"] = shown
    except FormatError as e:  # the shape is whole without them
        notes.append(f"materials are ignored: {e.problem}")
    if unknown.any():
        some = ", ".join(repr(str(key)[:20]) for key in np.unique(keys[unknown])[:8])
        notes.append(f"skipped {unknown.sum()} lines whose keywords OBJ does not define: {some}")
    return {**arrays, "faces": triangles, "notes": np.array(notes, dtype=np.str_)}


def _materials(words: list[list[str]], keys: np.ndarray, corners: list[list[str]]) -> tuple[list[str], IntArray]:
    """Return the names of `usemtl` lines, and which holds for each triangle that `_polygons` become, -1 for none."""
    named = keys == "usemtl"
    current = np.cumsum(named)[keys == "f"] - 1
    sides = np.array([len(c) for c in corners])
    used = [np.repeat(current[sides == n], n - 2) for n in np.unique(sides)]
    names = [words[i][1] if len(words[i]) > 1 else "" for i in np.flatnonzero(named)]
    return names, np.concatenate(used).astype(np.int32)


def _join_continued(lines: list[str]) -> list[str]:
    """Join lines that end in a backslash; empty lines keep the line numbers."""
    if not any(line.endswith("\\") for line in lines):
        return lines
    joined = list(lines)
    for i in range(len(joined) - 2, -1, -1):
        if joined[i].endswith("\\"):
            joined[i], joined[i + 1] = f"{joined[i][:-1]} {joined[i + 1]}", ""
    return joined


def _polygons(
    corners: list[list[str]], rows: list[str], at: list[int], seen: np.ndarray, path: Path
) -> list[np.ndarray]:
    """Polygons as vertex indices from 0, grouped by their number of corners.

    Args:
        corners: Of each face, as written.
        rows: What follows each `f`.
        at: Line of each.
        seen: Vertices given before each; negative indices count back from there.
        path: The file.
    """
    sides = np.array([len(c) for c in corners])
    for i in np.flatnonzero(sides < 3):
        raise FormatError(f"a face with {sides[i]} corners", where=f"{path}, line {at[i]}", hint=CUT_OFF)
    groups = []
    for n in np.unique(sides):
        chosen = np.flatnonzero(sides == n)
        named = [" ".join(corner.split("/", 1)[0] or corner for corner in corners[i]) for i in chosen]
        numbers = parse_numbers(named, [at[i] for i in chosen], path).reshape(-1, n)
        backward = numbers < 0
        indices = np.where(backward, numbers + seen[chosen, None], numbers - 1)
        wrong = ((numbers == 0) | (indices < 0)).any(axis=1)
        for i in np.flatnonzero(wrong):
            problem = f"face {rows[chosen[i]].strip()[:60]!r}: vertex numbers are counted from 1, or from -1 backwards"
            raise FormatError(problem, where=f"{path}, line {at[chosen[i]]}")
        groups.append(indices)
    return groups


def _texture(
    corners: list[list[str]], at: list[int], seen: np.ndarray, given: tuple[list[str], list[int]], path: Path
) -> FloatArray:
    """Return the texture coordinates of the triangles that `_polygons` become, NaN where none is given: (F, 3, 2).

    Args:
        corners: Of each face, as written: vertex/texture/normal.
        at: Line of each.
        seen: Texture coordinates given before each; negative indices count back from there.
        given: What follows each `vt`, and its line.
        path: The file.

    Raises:
        FormatError: none of that number exists.
    """
    values = parse_rows(*given, path)
    if values.shape[1] < 2 or not np.isfinite(values).all():
        raise FormatError("expected two finite numbers in each", where=str(path))
    sides = np.array([len(c) for c in corners])
    found = []
    for n in np.unique(sides):
        chosen = np.flatnonzero(sides == n)
        named = [" ".join("".join(corner.split("/")[1:2]) or "nan" for corner in corners[i]) for i in chosen]
        numbers = parse_numbers(named, [at[i] for i in chosen], path).reshape(-1, n)
        indices = np.where(numbers < 0, numbers + seen[chosen, None], numbers - 1)
        absent = np.isnan(numbers)
        fits = (indices >= 0) & (indices < len(values)) & (indices == np.trunc(indices))
        wrong = (numbers == 0) | ~(fits | absent)
        for i in np.flatnonzero(wrong.any(axis=1)):
            raise FormatError("a corner names one that is not there", where=f"{path}, line {at[chosen[i]]}")
        last = np.vstack([values[:, :2], np.full((1, 2), np.nan)])
        found.append(last[fan_triangulation(np.where(absent, len(values), indices))])
    return np.concatenate(found)
