"""Folders of depth frames as others lay them out: TUM, 7-Scenes, ScanNet, Stray Scanner.

Their poses are camera to world, x right, y down, z forward. They come from a phone's own tracking or another program,
good to centimetres, and are refined.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.files import check_file, listed
from vto_pipeline.io.text_numbers import parse_rows, read_lines
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics

PICTURES = frozenset({".png", ".jpg", ".jpeg"})
TEXT_BYTES = 100_000_000

MATCHING_S = 0.02
"""Colour, depth and pose of one frame lie no further apart in time [s], as in the tools of the TUM benchmark."""

TUM_SCALE, TUM_LENS = 5000.0, (525.0, 525.0, 319.5, 239.5)
"""Stored units per metre, and the lens that its authors recommend where none is calibrated."""

SEVEN_SCENES_LENS = (585.0, 585.0, 320.0, 240.0)
"""As its authors give it."""

STRAY_SIZE = (1920, 1440)
"""Of the video that camera_matrix.csv belongs to [px]."""


@dataclass(frozen=True)
class RgbdLayout:
    """What a folder holds, before any picture is read.

    Args:
        name: Of the layout.
        depth, color, confidence: Files, N each or none.
        lens: fx, fy, cx, cy of the depth camera [px].
        lens_size: Width and height [px] that `lens` belongs to; None: those of the depth frames.
        color_lens: Of the colour camera, or None when colours are registered to the depth.
        scale: Stored units per metre.
        poses: world_from_cam [m], shape (N, 4, 4), NaN where there is none; or None.
        assumed: What was not in the folder.
    """

    name: str
    depth: tuple[Path, ...]
    color: tuple[Path, ...]
    lens: tuple[float, float, float, float]
    scale: float
    poses: FloatArray | None = None
    confidence: tuple[Path, ...] = ()
    lens_size: tuple[int, int] | None = None
    color_lens: tuple[float, float, float, float] | None = None
    assumed: str = ""


def find_layout(folder: Path) -> str | None:
    """The name of a folder's layout, or None."""
    if (folder / "depth.txt").is_file() and (folder / "depth").is_dir():
        return "TUM"
    if (folder / "odometry.csv").is_file() and (folder / "depth").is_dir():
        return "Stray Scanner"
    if (folder / "pose").is_dir() and (folder / "depth").is_dir():
        return "ScanNet"
    if any(folder.glob("frame-*.depth.png")):
        return "7-Scenes"
    return None


def read_layout(folder: Path) -> RgbdLayout:
    """Read a folder in one of the layouts of `find_layout`.

    Raises:
        FormatError: a file is missing or is not what its layout says.
    """
    read = {"TUM": _tum, "Stray Scanner": _stray, "ScanNet": _scannet, "7-Scenes": _seven_scenes}
    return read[str(find_layout(folder))](folder)


def _tum(folder: Path) -> RgbdLayout:
    depth_times, depth = _timed_files(folder / "depth.txt", folder)
    color: tuple[Path, ...] = ()
    if (folder / "rgb.txt").is_file():
        color_times, colors = _timed_files(folder / "rgb.txt", folder)
        nearest = _nearest(color_times, depth_times)
        near = np.abs(color_times[nearest] - depth_times) <= MATCHING_S
        if not near.any():
            problem = f"no colour frame is within {MATCHING_S} s of a depth frame"
            raise FormatError(problem, where=str(folder / "rgb.txt"))
        depth_times, depth = depth_times[near], tuple(d for d, ok in zip(depth, near, strict=True) if ok)
        color = tuple(colors[k] for k in nearest[near])
    poses = None
    if (folder / "groundtruth.txt").is_file():
        rows = _table(folder / "groundtruth.txt", 8)
        poses = _interpolated(rows[:, 0], _rigid(rows[:, 1:4], rows[:, 4:8], folder / "groundtruth.txt"), depth_times)
    lens, assumed = _lens_or(folder, TUM_LENS, "the lens that the TUM benchmark recommends")
    return RgbdLayout("TUM", depth, color, lens, TUM_SCALE, poses, assumed=assumed)


def _seven_scenes(folder: Path) -> RgbdLayout:
    depth = tuple(sorted(folder.glob("frame-*.depth.png")))
    stems = [path.name.removesuffix(".depth.png") for path in depth]
    found = {path.name.split(".color.")[0]: path for path in folder.glob("frame-*.color.*") if path.suffix in PICTURES}
    color = _one_each(stems, found, folder, "color") if found else ()
    texts = {path.name.removesuffix(".pose.txt"): path for path in folder.glob("frame-*.pose.txt")}
    poses = _matrices(_one_each(stems, texts, folder, "pose")) if texts else None
    lens, assumed = _lens_or(folder, SEVEN_SCENES_LENS, "the lens of the 7-Scenes camera")
    return RgbdLayout("7-Scenes", depth, color, lens, 1000.0, poses, assumed=assumed)


def _scannet(folder: Path) -> RgbdLayout:
    depth = _numbered(folder / "depth", PICTURES)
    stems = [path.stem for path in depth]
    color: tuple[Path, ...] = ()
    color_lens = None
    if (folder / "color").is_dir():
        color = _one_each(stems, {p.stem: p for p in _numbered(folder / "color", PICTURES)}, folder, "color")
        color_lens = _lens(folder / "intrinsic" / "intrinsic_color.txt")
    poses = _matrices(_one_each(stems, {p.stem: p for p in _numbered(folder / "pose", {".txt"})}, folder, "pose"))
    lens = _lens(folder / "intrinsic" / "intrinsic_depth.txt")
    return RgbdLayout("ScanNet", depth, color, lens, 1000.0, poses, color_lens=color_lens)


def _stray(folder: Path) -> RgbdLayout:
    depth = _numbered(folder / "depth", {".png"})
    path = folder / "odometry.csv"
    lines = [line for line in read_lines(check_file(path, {".csv"}, TEXT_BYTES, error=FormatError)) if line.strip()]
    names = [name.strip() for name in lines[0].split(",")] if lines else []
    wanted = ["x", "y", "z", "qx", "qy", "qz", "qw"]
    if not {"frame", *wanted} <= set(names):
        problem = f"columns {', '.join(names)[:80]}; expected frame, {', '.join(wanted)}"
        raise FormatError(problem, where=str(path))
    rows = parse_rows([line.replace(",", " ") for line in lines[1:]], range(2, len(lines) + 1), path)
    if rows.shape[1] != len(names) or not np.isfinite(rows).all():
        raise FormatError(f"expected rows of {len(names)} finite numbers, as in the first line", where=str(path))
    values = rows[:, [names.index(name) for name in wanted]]
    pose_of = dict(
        zip(rows[:, names.index("frame")].astype(int), _rigid(values[:, :3], values[:, 3:], path), strict=True)
    )
    poses = np.stack([pose_of.get(int(p.stem), np.full((4, 4), np.nan)) for p in depth])
    confidence: tuple[Path, ...] = ()
    if (folder / "confidence").is_dir():
        sure = {p.stem: p for p in _numbered(folder / "confidence", {".png"})}
        confidence = _one_each([p.stem for p in depth], sure, folder, "confidence")
    lens = _lens(folder / "camera_matrix.csv")
    assumed = "colours stay in rgb.mp4 and are not used"
    return RgbdLayout("Stray Scanner", depth, (), lens, 1000.0, poses, confidence, STRAY_SIZE, assumed=assumed)


def _timed_files(path: Path, folder: Path) -> tuple[FloatArray, tuple[Path, ...]]:
    """Times [s] and files of a list with lines "time name", sorted by time."""
    times, files = [], []
    for number, line in enumerate(read_lines(check_file(path, {".txt"}, TEXT_BYTES, error=FormatError)), 1):
        if not line.strip() or line.startswith("#"):
            continue
        match = re.fullmatch(r"\s*([0-9.eE+-]+)\s+(\S+)\s*", line)
        if match is None:
            raise FormatError(f"{line[:40]!r} is not a time and a file name", where=f"{path}, line {number}")
        name = Path(match[2])
        if name.is_absolute() or ".." in name.parts:
            raise FormatError(f"{match[2]!r} leads out of the folder", where=f"{path}, line {number}")
        times.append(float(parse_rows([match[1]], [number], path)[0, 0]))
        files.append(folder / name)
    if not files:
        raise FormatError("the list is empty", where=str(path))
    order = np.argsort(times, kind="stable")
    return np.array(times)[order], tuple(files[k] for k in order)


def _table(path: Path, columns: int) -> FloatArray:
    """The numbers of a text file without its comments, shape (N, columns)."""
    lines = read_lines(check_file(path, {".txt", ".csv"}, TEXT_BYTES, error=FormatError))
    kept = [(line.replace(",", " "), k) for k, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if not kept:
        raise FormatError("the file holds no numbers", where=str(path))
    rows = parse_rows([line for line, _ in kept], [k for _, k in kept], path)
    if rows.shape[1] != columns:
        raise FormatError(f"rows of {rows.shape[1]} numbers; expected {columns}", where=str(path))
    return rows


def _rigid(shift: FloatArray, quaternion: FloatArray, path: Path) -> FloatArray:
    """Transforms (N, 4, 4) of translations (N, 3) and quaternions x, y, z, w (N, 4)."""
    length = np.linalg.norm(quaternion, axis=1)
    bad = np.flatnonzero(~(np.abs(length - 1.0) < 1e-2) | ~np.isfinite(shift).all(axis=1))
    if len(bad):
        raise FormatError(f"row {bad[0] + 1} is not a position and a unit quaternion x, y, z, w", where=str(path))
    poses = np.tile(np.eye(4), (len(shift), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = Rotation.from_quat(quaternion).as_matrix(), shift
    return poses


def _interpolated(times: FloatArray, poses: FloatArray, wanted: FloatArray) -> FloatArray:
    """Poses at other times, NaN where the known ones are too far apart or away, shape (len(wanted), 4, 4)."""
    order = np.argsort(times, kind="stable")
    times, first = np.unique(times[order], return_index=True)
    poses = poses[order][first]
    found = np.full((len(wanted), 4, 4), np.nan)
    inside = (wanted >= times[0]) & (wanted <= times[-1])
    near = inside & (np.abs(times[_nearest(times, wanted)] - wanted) <= MATCHING_S)
    if len(times) > 1 and near.any():
        found[near] = np.eye(4)
        turn = Slerp(times, Rotation.from_matrix(poses[:, :3, :3]))
        found[near, :3, :3] = turn(wanted[near]).as_matrix()
        found[near, :3, 3] = np.column_stack([np.interp(wanted[near], times, poses[:, k, 3]) for k in range(3)])
    return found


def _nearest(times: FloatArray, wanted: FloatArray) -> FloatArray:
    """Index of the nearest of some sorted times to each wanted one."""
    after = np.clip(np.searchsorted(times, wanted), 1, max(len(times) - 1, 1))
    after = np.minimum(after, len(times) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(times[before] - wanted) <= np.abs(times[after] - wanted), before, after)


def _numbered(folder: Path, suffixes: set[str] | frozenset[str]) -> tuple[Path, ...]:
    """Files named by numbers, in the order of these: 2.png before 10.png."""
    files = [path for path in listed(folder, suffixes) if path.stem.isdecimal()] if folder.is_dir() else []
    if not files:
        raise FormatError(f"there are no files named by numbers ({', '.join(sorted(suffixes))})", where=str(folder))
    return tuple(sorted(files, key=lambda path: int(path.stem)))


def _one_each(stems: list[str], files: dict[str, Path], folder: Path, what: str) -> tuple[Path, ...]:
    missing = [stem for stem in stems if stem not in files]
    if missing:
        problem = f"{len(missing)} of {len(stems)} depth frames have no {what}; the first is {missing[0]}"
        raise FormatError(problem, where=str(folder))
    return tuple(files[stem] for stem in stems)


def _matrices(paths: tuple[Path, ...]) -> FloatArray:
    """Poses in files of 4 x 4 numbers, shape (N, 4, 4); NaN where a file holds infinite ones: tracking was lost."""
    poses = []
    for path in paths:
        rows = _table(path, 4)
        if rows.shape != (4, 4):
            raise FormatError(f"{rows.shape[0]} rows of numbers; expected 4", where=str(path))
        poses.append(rows if np.isfinite(rows).all() else np.full((4, 4), np.nan))
    return np.stack(poses)


def _lens(path: Path) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of a file with a 3 x 3 or 4 x 4 camera matrix."""
    lines = [
        line for line in read_lines(check_file(path, {".txt", ".csv"}, TEXT_BYTES, error=FormatError)) if line.strip()
    ]
    rows = parse_rows([line.replace(",", " ") for line in lines], range(1, len(lines) + 1), path)
    if rows.shape not in ((3, 3), (4, 4)) or not (rows[0, 0] > 0 and rows[1, 1] > 0):
        raise FormatError(f"expected a camera matrix of 3 x 3 or 4 x 4 numbers, got {rows.shape}", where=str(path))
    return float(rows[0, 0]), float(rows[1, 1]), float(rows[0, 2]), float(rows[1, 2])


def _lens_or(
    folder: Path, lens: tuple[float, float, float, float], what: str
) -> tuple[tuple[float, float, float, float], str]:
    """The lens of camera-intrinsics.txt in the folder or above it, or an assumed one, and what was assumed."""
    for place in (folder, folder.parent):
        if (place / "camera-intrinsics.txt").is_file():
            return _lens(place / "camera-intrinsics.txt"), ""
    return lens, f"assumed {what}; camera-intrinsics.txt with the 3 x 3 camera matrix says otherwise"


def camera_of(lens: tuple[float, float, float, float], size: tuple[int, int], of: tuple[int, int] | None) -> Intrinsics:
    """The camera of pictures of one size [px] from a lens that belongs to another.

    Raises:
        InputError: their aspect ratios differ.
    """
    wide = 1.0 if of is None else size[0] / of[0]
    high = 1.0 if of is None else size[1] / of[1]
    if abs(wide / high - 1.0) > 0.02:
        raise InputError(f"depth frames of {size[0]} x {size[1]} px do not have the shape of the video's {of}")
    fx, fy, cx, cy = lens
    return Intrinsics(*size, fx * wide, fy * high, (cx + 0.5) * wide - 0.5, (cy + 0.5) * high - 0.5)
