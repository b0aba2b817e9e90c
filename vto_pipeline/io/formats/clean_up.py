"""Clean up a mesh from a file: refuse what is wrong, drop what is needless, report every change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.numerics.volume import FLAT, axis_volumes


def check_sound(arrays: Arrays, path: Path) -> None:
    """Refuse coordinates that are not finite and faces that name no vertex.

    Raises:
        FormatError: with the first fault.
    """
    vertices = arrays["vertices"]
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        values = ", ".join(f"{v:g}" for v in vertices[bad[0]])
        problem = f"vertex {bad[0]} is ({values}): {len(bad)} of {len(vertices)} vertices are not finite"
        raise FormatError(problem, where=str(path), hint="remove them in the program that wrote the file")
    faces = arrays.get("faces")
    if faces is not None and len(faces):
        wrong = np.flatnonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))
        if len(wrong):
            indices = ", ".join(str(int(i)) for i in faces[wrong[0]])
            problem = f"face {wrong[0]} has the vertices {indices}; there are vertices 0 to {len(vertices) - 1}"
            raise FormatError(problem, where=str(path), hint="is the file truncated, or were vertices removed from it?")


def merge_duplicate_vertices(arrays: Arrays) -> tuple[Arrays, list[str]]:
    """Merge vertices at exactly the same place: STL repeats each vertex for each of its faces.

    Returns:
        The arrays with vertices in the order of their first use, and the log.
    """
    vertices = arrays["vertices"] + 0.0  # -0 and 0 are one place
    _, first, inverse = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    joined = {**arrays, "vertices": vertices[first[order]], "faces": rank[inverse.ravel()][arrays["faces"]]}
    return joined, [f"joined {len(vertices)} separate corners into {len(order)} vertices"]


def turn_outward(arrays: Arrays) -> tuple[Arrays, list[str]]:
    """Turn all faces over where the whole surface is inside out.

    The middle of three volumes decides, so that neither a floor nor an end left open does.

    Returns:
        The arrays, and the log.
    """
    faces = arrays["faces"]
    volumes, area = axis_volumes(arrays["vertices"], faces, np.zeros(len(faces), np.int32), 1)
    if np.median(volumes) >= -FLAT * area[0] ** 1.5:
        return arrays, []
    turned: Arrays = {name: arrays[name][:, ::-1] for name in ("faces", "texture", "places") if name in arrays}
    return {**arrays, **turned}, ["the surface was inside out: its faces are turned over"]


def drop_degenerate(arrays: Arrays) -> tuple[Arrays, list[str]]:
    """Drop faces that use a vertex twice, and then vertices that no face uses.

    Returns:
        The arrays, and the log.
    """
    faces, notes = arrays["faces"], []
    a, b, c = faces.T
    proper = (a != b) & (b != c) & (c != a)
    if not proper.all():
        notes.append(f"dropped {int((~proper).sum())} faces that use a vertex twice")
        faces = faces[proper]
        arrays = {**arrays, **{name: arrays[name][proper] for name in ("texture", "places") if name in arrays}}
    used = np.zeros(len(arrays["vertices"]), dtype=bool)
    used[faces.ravel()] = True
    if used.all() or not len(faces):
        return {**arrays, "faces": faces}, notes
    notes.append(f"dropped {int((~used).sum())} vertices that no face uses")
    number: NDArray[np.int64] = np.cumsum(used) - 1
    kept: Arrays = {name: values[used] for name, values in arrays.items() if name in ("vertices", "normals", "colors")}
    return {**arrays, **kept, "faces": number[faces]}, notes
