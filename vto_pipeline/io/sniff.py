"""Detect what a path holds, and so where it enters the pipeline."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

from vto_pipeline.errors import InputError
from vto_pipeline.io import clouds, meshes
from vto_pipeline.io.bodies import makehuman
from vto_pipeline.io.captures import images, photos, video
from vto_pipeline.io.captures.rgbd_layouts import find_layout
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.io.fabric_formats.u3m import is_u3m
from vto_pipeline.io.files import listed
from vto_pipeline.io.formats.ply_header import read_header
from vto_pipeline.io.patterns.read import is_pattern

_WANTED = (
    "a folder of photos, of depth frames, of front and side pictures, or of MakeHuman; a video, a point cloud, a mesh, "
    "a body model, a measurements file, a fabric file, a sewing pattern, or an avatar"
)
_TOLD_BY = {
    "measurements": "measurements",
    "size": "measurements",
    "areal_density_gsm": "fabric",
    "instrument": "fabric",
}
"""Key of a document -> what such a document holds."""


def find_kind(path: Path) -> tuple[str, str]:
    """Return what a path holds, by its name, its header, and for a folder its contents.

    Args:
        path: File or folder.

    Returns:
        "photos", "video", "depth", "cloud", "surface", "silhouettes", "measurements", "fabric", "avatar" or "pattern",
        and the reason.

    Raises:
        InputError: nothing there, or nothing known.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("no such file or folder", where=str(path))
    if not path.is_dir() and not path.is_file():
        raise InputError("neither a file nor a folder", where=str(path))
    found = _folder(path) if path.is_dir() else _file(path)
    if found is None:
        raise InputError("cannot tell what this is", where=str(path), hint=f"expected {_WANTED}")
    return found


def _folder(path: Path) -> tuple[str, str] | None:
    if (path / "intrinsics.json").is_file() and (path / "depth").is_dir():
        return "depth", "it holds intrinsics.json and depth/"
    layout = find_layout(path)
    if layout is not None:
        return "depth", f"it holds depth frames as {layout} lays them out"
    if (path / makehuman.BASE).is_file():
        return "surface", f"it holds MakeHuman's {makehuman.BASE}"
    pictures = listed(path, images.SUFFIXES)
    if {"front", "side"} <= {p.stem.lower() for p in pictures} and (path / "stature.yaml").is_file():
        return "silhouettes", "it holds front and side pictures and stature.yaml"
    if pictures := listed(path, photos.PHOTO_SUFFIXES):
        return "photos", f"it holds {len(pictures)} pictures"
    if len(listed(path, video.SUFFIXES)) == 1:
        return "video", "it holds a video"
    return None


def _file(path: Path) -> tuple[str, str] | None:
    suffix = path.suffix.lower()
    if suffix == ".npz":
        if "v_template.npy" in _members(path):
            return "surface", "it is an .npz archive of a body model"
        return "avatar", "it is an .npz archive"
    if suffix in (".dxf", ".svg"):
        return "pattern", f"{suffix} files hold sewing patterns"
    if suffix == ".json" and is_pattern(path):
        return "pattern", "it holds panels"
    if suffix in (".yaml", ".yml", ".json"):
        data = load_yaml(path, error=InputError).data
        if is_u3m(data):
            return "fabric", "it is a U3M material, or an analyser's file"
        told = [key for key in _TOLD_BY if isinstance(data, dict) and key in data]
        return (_TOLD_BY[told[0]], f"it has the key {told[0]}") if told else None
    if suffix == ".u3m":
        return "fabric", "it is a U3M material"
    if suffix == ".csv" and _first_word(path) == "instrument":
        return "fabric", "it is an instrument's sheet"
    if suffix == ".ply":
        return _ply(path)
    if suffix in video.SUFFIXES:
        return "video", f"{suffix} files hold videos"
    if suffix in clouds.PARSERS:
        return "cloud", f"{suffix} files hold points"
    if suffix in meshes.PARSERS:
        return "surface", f"{suffix} files hold meshes"
    return None


def _members(path: Path) -> list[str]:
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.namelist()
    except (zipfile.BadZipFile, OSError):
        return []


def _first_word(path: Path) -> str:
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        return re.split("[,;]", stream.readline(100))[0].strip()


def _ply(path: Path) -> tuple[str, str]:
    header = read_header(path.read_bytes(), path)
    faces = sum(e.count for e in header.elements if e.name == "face")
    if faces:
        return "surface", f"its header counts {faces} faces"
    return "cloud", "its header counts points and no faces"
