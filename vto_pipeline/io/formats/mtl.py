"""The materials beside an OBJ file: the colour and the picture of each.

Files are looked for in the folder of the OBJ file and below, and nowhere else. A name that leads elsewhere, as those
with drive letters do, is tried without its folders.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.formats.atlas import decode_picture, join_pictures, plain_picture
from vto_pipeline.io.text_numbers import read_lines
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray

_LIMIT_BYTES = 200_000_000
_OPTIONS = re.compile(r"(-\w+\s+(?:(?:on|off|[-+.\deE]+)\s+)*)*")  # before the name of a picture
_WHITE = np.full(3, 255, np.uint8)


class Material(NamedTuple):
    """What a material says of its colour.

    Args:
        color: sRGB, 0 to 1, or None.
        picture: Name of its picture, or None; it stands for the colour, as most programs have it.
    """

    color: tuple[float, float, float] | None = None
    picture: str | None = None


def find_beside(path: Path, name: str) -> Path | None:
    """Return the file of a name in the folder of another file or below; None where there is none."""
    folder = path.resolve().parent
    plain = PurePosixPath(name.strip().strip('"').replace("\\", "/"))
    for tried in (plain, PurePosixPath(plain.name)):
        try:
            target = (folder / tried).resolve()
            if target.is_relative_to(folder) and target.is_file():
                return target
        except (OSError, ValueError, RuntimeError):  # not a name that a file can have
            continue
    return None


def library_files(path: Path, libraries: Sequence[str]) -> Iterator[Path]:
    """Yield the files that `mtllib` lines name, each line one name or several."""
    for line in libraries:
        whole = find_beside(path, line)
        for found in [whole] if whole is not None else [find_beside(path, name) for name in line.split()]:
            if found is not None and found.stat().st_size <= _LIMIT_BYTES:
                yield found


def read_materials(path: Path) -> dict[str, Material]:
    """Read the materials of an MTL file.

    Raises:
        FormatError: it holds bytes that are no text.
    """
    found: dict[str, Material] = {}
    name = None
    for line in read_lines(path):
        key, _, rest = line.strip().partition(" ")
        rest = rest.strip()
        if key == "newmtl":
            name = rest
            found[name] = Material()
        elif name is not None and key == "Kd":
            numbers = re.findall(r"[-+.\deE]+", rest)[:3]
            try:
                red, green, blue = (min(max(float(number), 0.0), 1.0) for number in numbers)
            except ValueError:  # a spectrum, or none
                continue
            found[name] = found[name]._replace(color=(red, green, blue))
        elif name is not None and key.lower() == "map_kd":
            match = _OPTIONS.match(rest)
            found[name] = found[name]._replace(picture=rest[match.end() if match else 0 :])
    return found


def material_picture(
    path: Path, libraries: Sequence[str], names: Sequence[str], used: IntArray, places: FloatArray | None
) -> tuple[ByteArray, FloatArray] | None:
    """Return the colours and pictures of an OBJ file's materials as one picture, and where its triangles lie there.

    Args:
        path: The OBJ file.
        libraries: What follows each `mtllib`.
        names: What follows each `usemtl`.
        used: Index in `names` for each triangle, -1 for none, shape (F,).
        places: Texture coordinates of the triangles' corners, v up, shape (F, 3, 2), NaN where there are none; or None.

    Returns:
        sRGB, shape (H, W, 3), and texture coordinates there, v up, shape (F, 3, 2); None where nothing has a colour.

    Raises:
        FormatError: a picture is absent, broken or too large.
    """
    known: dict[str, Material] = {}
    for file in library_files(path, libraries):
        known |= read_materials(file)
    of_name = {k: known.get(names[k].strip(), Material()) if k >= 0 else Material() for k in np.unique(used).tolist()}
    materials = list(dict.fromkeys(of_name.values()))
    if materials == [Material()]:
        return None
    number = {k: materials.index(material) for k, material in of_name.items()}
    worn = np.array([number[k] for k in used.tolist()])
    if places is None:
        places = np.full((len(used), 3, 2), np.nan)
    pictured = np.array([material.picture is not None for material in materials])[worn]
    lies = pictured & np.isfinite(places).all(axis=(1, 2))
    pictures, parts, kept = [], [], []
    for k, material in enumerate(materials):
        for there in (True, False):
            own = np.flatnonzero((worn == k) & (lies == there))
            if len(own):
                pictures.append(_picture(path, material) if there else _plain(material))
                parts.append(places[own] if there else np.full((len(own), 3, 2), 0.5))
                kept.append(own)
    whole, joined = join_pictures(pictures, parts)
    moved = np.empty_like(joined)
    moved[np.concatenate(kept)] = joined
    return whole, moved


def _plain(material: Material) -> ByteArray:
    return plain_picture(_WHITE if material.color is None else np.rint(255 * np.array(material.color)).astype(np.uint8))


def _picture(path: Path, material: Material) -> ByteArray:
    assert material.picture is not None
    file = find_beside(path, material.picture)
    if file is None or file.stat().st_size > _LIMIT_BYTES:
        raise FormatError(
            f"the picture {material.picture[:80]!r} is not beside the file, or too large", where=str(path)
        )
    return decode_picture(file.read_bytes(), str(file))


def named_pictures(path: Path, library: Path) -> Iterator[Path]:
    """Yield the pictures beside an OBJ file that one of its libraries names.

    Raises:
        FormatError: the library is no text.
    """
    for material in read_materials(library).values():
        file = None if material.picture is None else find_beside(path, material.picture)
        if file is not None:
            yield file
