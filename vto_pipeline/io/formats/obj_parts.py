"""Parts with materials as Wavefront OBJ, with an MTL file and the pictures beside it.

The writer is our own: trimesh 5.2 numbers texture coordinates as it numbers vertices, so that a part without them
shifts those of all parts after it (tried).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.io.files import replacing
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.render import GlbPart
from vto_pipeline.numerics.srgb import srgb_curve


def obj_files(path: Path, parts: Sequence[GlbPart]) -> dict[str | int, Path]:
    """Return where an OBJ file, its materials and its pictures go: "obj", "mtl" and numbers of parts -> file."""
    stem = _plain_name(path.stem)
    pictured = [k for k, part in enumerate(parts) if part.texture is not None]
    pictures: dict[str | int, Path] = {k: path.with_name(f"{stem}_{k}.png") for k in pictured}
    return {"obj": path, "mtl": path.with_name(f"{stem}.mtl"), **pictures}


def write_obj(path: Path, parts: Sequence[GlbPart]) -> None:
    """Write parts as one OBJ file: metres, +Y up, one object and one material a part, pictures as PNG.

    A material has Kd, as sRGB, and map_Kd; opacity (d), roughness (Pr) and metallic (Pm), which not all programs read.
    Vertices without a picture have their colours behind their coordinates, which is usual though no standard.

    Args:
        path: The file; the others lie beside it.
        parts: At least one, with names of their own.

    Raises:
        InputError: no part, or two of one name.
    """
    from PIL import Image

    names = [part.name for part in parts]
    if not parts or len(set(names)) != len(names):
        raise InputError(f"an OBJ file needs parts of different names; got {names}")
    files = obj_files(path, parts)
    for k, part in enumerate(parts):
        if part.texture is not None:
            with replacing(files[k]) as beside:
                Image.fromarray(part.texture).save(beside, format="png")
    materials = [_material(k, part, files.get(k)) for k, part in enumerate(parts)]
    with replacing(files["mtl"]) as beside:
        beside.write_text("\n".join(materials), encoding="utf-8")
    colored = any(part.mesh.colors is not None for part in parts)  # readers want as many numbers in every line
    counts = np.zeros(3, int)  # of vertices, texture coordinates and normals so far; OBJ counts from 1
    with replacing(path) as beside, beside.open("w", encoding="utf-8") as stream:
        stream.write(f"# metres, +Y up\nmtllib {files['mtl'].name}\n")
        for k, part in enumerate(parts):
            points = part.mesh.vertices
            if colored:
                points = np.hstack([points, np.ones_like(points) if (own := part.mesh.colors) is None else own / 255])
            stream.write(f"o {_plain_name(part.name)}\nusemtl {_material_name(k, part)}\n{_rows('v', points)}")
            listed = [part.uv, part.normals]
            if part.uv is not None:
                stream.write(_rows("vt", part.uv * (1.0, -1.0) + (0.0, 1.0)))
            if part.normals is not None:
                stream.write(_rows("vn", part.normals))
            stream.write(_faces(part.mesh.faces, counts + 1, [values is not None for values in listed]))
            counts += [len(points), *(0 if values is None else len(values) for values in listed)]


def _material(number: int, part: GlbPart, picture: Path | None) -> str:
    red, green, blue = srgb_curve(np.array(part.base_color[:3])) if picture is None else (1.0, 1.0, 1.0)
    lines = [
        f"newmtl {_material_name(number, part)}",
        f"Kd {red:.6f} {green:.6f} {blue:.6f}",
        "Ks 0 0 0",
        f"d {part.base_color[3]:g}",
        f"Pr {part.roughness:g}",
        f"Pm {part.metallic:g}",
    ]
    return "\n".join([*lines, *([] if picture is None else [f"map_Kd {picture.name}"]), ""])


def _material_name(number: int, part: GlbPart) -> str:
    return f"{number}_{_plain_name(part.name)}"


def _plain_name(name: str) -> str:
    """A name that every program reads: letters, digits, and bars for all else."""
    return re.sub(r"[^A-Za-z0-9.-]+", "_", name) or "part"


def _rows(key: str, values: FloatArray) -> str:
    """One line a row, to a tenth of a micrometre."""
    row = f"{key} " + " ".join(["%.7f"] * values.shape[1]) + "\n"
    return (row * len(values)) % tuple(values.ravel().tolist())


def _faces(faces: np.ndarray, first: np.ndarray, given: Sequence[bool]) -> str:
    """One line a face; each corner has the number of its vertex, texture coordinate and normal, as far as given."""
    uv, normal = given
    corner = "%d" + ("/%d" if uv else "/" if normal else "") + ("/%d" if normal else "")
    kept = first[[True, uv, normal]]
    numbers = (faces[:, :, None] + kept).reshape(len(faces), -1)
    return (f"f {corner} {corner} {corner}\n" * len(faces)) % tuple(numbers.ravel().tolist())
