"""Measurements, silhouettes and landmarks of a body."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.bodies.size_letters import chest_range
from vto_pipeline.io.captures.images import SUFFIXES, check_images
from vto_pipeline.io.documents import Document, check_schema, load_yaml, read_json, suggest, write_json
from vto_pipeline.io.files import check_folder, listed
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.frames import Silhouettes
from vto_pipeline.model.settings import Config
from vto_pipeline.units import LENGTH_M

_NAMES = """
head_girth neck_girth neck_base_girth chest_girth bust_girth underbust_girth
waist_girth navel_girth high_hip_girth hip_girth max_hip_girth
armscye_girth upper_arm_girth elbow_girth forearm_girth wrist_girth thigh_girth knee_girth calf_girth ankle_girth
chest_depth waist_breadth waist_depth hip_breadth hip_depth
stature back_neck_height shoulder_height chest_height waist_height navel_height hip_height thigh_height knee_height
torso_height inside_leg
shoulder_length back_shoulder_width across_back_shoulder_width back_width across_front_width scye_depth
back_neck_to_waist back_neck_to_waist_level back_neck_to_navel front_neck_to_waist back_neck_to_wrist outer_arm_length
mass
"""
MEASUREMENT_NAMES = frozenset(_NAMES.split())
"""Names of ISO 8559-1 in snake case, and mass."""

# titles of ISO 8559-1 that differ from our names
_TITLES = {
    "maximum_hip_girth": "max_hip_girth",
    "scye_depth_length": "scye_depth",
    "back_neck_point_to_waist": "back_neck_to_waist",
    "back_neck_point_to_waist_level": "back_neck_to_waist_level",
    "front_neck_point_to_waist": "front_neck_to_waist",
    "back_neck_point_to_wrist_length": "back_neck_to_wrist",
    "across_back_shoulder_width_through_the_back_neck_point": "across_back_shoulder_width",
    "inside_leg_length": "inside_leg",
    "inside_leg_height": "inside_leg",
    "body_mass": "mass",
}

# words of everyday, for the hint alone: what a tailor calls waist is not always the waist of ISO 8559-1
_EVERYDAY = {
    "height": "stature",
    "body_height": "stature",
    "weight": "mass",
    "bust": "bust_girth",
    "chest": "chest_girth",
    "waist": "waist_girth",
    "hip": "hip_girth",
    "hips": "hip_girth",
    "seat": "hip_girth",
    "neck": "neck_girth",
    "head": "head_girth",
    "thigh": "thigh_girth",
    "inseam": "inside_leg",
    "sleeve": "back_neck_to_wrist",
    "sleeve_length": "back_neck_to_wrist",
    "arm_length": "outer_arm_length",
    "shoulder_width": "back_shoulder_width",
}

_RANGES = {"mass": (10.0, 400.0), "stature": (0.5, 2.6)}  # kg, m
_TORSO = frozenset({"chest_girth", "bust_girth", "waist_girth", "hip_girth", "max_hip_girth"})
_TORSO_RANGE, _LENGTH_RANGE = (0.3, 2.6), (0.03, 2.6)  # m

Unit = Literal["m", "cm", "mm", "in"]


class MeasurementsFile(Config):
    """A measurements file."""

    sex: Literal["female", "male", "neutral"] = Field("neutral", description="Sex of the customer")
    unit: Unit = Field("cm", description="Unit of every length; mass is always in kg")
    size: str | None = Field(None, description="Size letter of EN 13402-3, for the middle of its chest or bust range")
    measurements: dict[str, float] = Field({}, description="ISO 8559-1 name -> value")
    sigmas: dict[str, float] = Field({}, description="Name -> standard uncertainty, in the same unit")
    caveats: tuple[str, ...] = Field((), description="Why these are estimates rather than measurements")


class StatureFile(Config):
    """stature.yaml, next to the silhouettes."""

    stature: float = Field(gt=0, description="Body height")
    unit: Unit = Field("m", description="Unit of the stature")


def read_measurements(source: Path | Mapping[str, Any]) -> Measurements:
    """Read measurements from a YAML or JSON file, or from a mapping of the same keys.

    Raises:
        InputError: an unknown key or name (with its line and a suggestion), a value no body has, as in a wrong unit, a
            size that is unknown or that the chest contradicts, or nothing at all.
    """
    document = _document(source)
    _refuse_bare(document)
    stored: MeasurementsFile = check_schema(document, MeasurementsFile, error=InputError)
    if not stored.measurements and stored.size is None:
        raise InputError("neither measurements nor size is given", where=str(document.path))
    for section in ("measurements", "sigmas"):
        for name in getattr(stored, section):
            if _snake(name) not in MEASUREMENT_NAMES:
                problem = f"{section}.{name}: unknown measurement (got {getattr(stored, section)[name]})"
                meant = _EVERYDAY.get(_snake(name))
                hint = f"did you mean {meant}?" if meant else suggest(_snake(name), MEASUREMENT_NAMES)
                raise InputError(problem, where=document.where((section, name)), hint=hint)

    def to_si(values: Mapping[str, float]) -> dict[str, float]:
        named = {_snake(name): value for name, value in values.items()}
        return {name: value * (1.0 if name == "mass" else LENGTH_M[stored.unit]) for name, value in named.items()}

    values = to_si(stored.measurements)
    for name, value in values.items():
        low, high = _RANGES.get(name, _TORSO_RANGE if name in _TORSO else _LENGTH_RANGE)
        if not low <= value <= high:
            unit = "kg" if name == "mass" else "m"
            problem = f"measurements.{name}: {value:.4g} {unit} is not plausible; expected {low} to {high} {unit}"
            hint = f"lengths were read in {stored.unit}; to change that, set unit: to m, cm, mm or in"
            written = next(key for key in stored.measurements if _snake(key) == name)
            raise InputError(problem, where=document.where(("measurements", written)), hint=hint)
    if stored.size is not None:
        values = _of_size(stored.size, stored.sex, values, document)
    return Measurements(values, to_si(stored.sigmas), stored.sex, stored.caveats)


def _refuse_bare(document: Document) -> None:
    """Refuse a measurement that stands at the top, where only the sections do."""
    for name, value in document.data.items() if isinstance(document.data, Mapping) else ():
        if _snake(str(name)) in MEASUREMENT_NAMES:
            problem = f"{name}: a measurement outside the section measurements (got {value!r})"
            hint = f"write it as measurements: {{{name}: {value}}}"
            raise InputError(problem, where=document.where((name,)), hint=hint)


def _snake(name: str) -> str:
    """Return our name of an ISO 8559-1 title ("Back neck point to waist"), also given in snake case."""
    written = "_".join(re.findall("[a-z0-9]+", name.lower()))
    return _TITLES.get(written, written)


def _of_size(letter: str, sex: str, values: dict[str, float], document: Document) -> dict[str, float]:
    """Add the chest of a letter size, or check it against the chest that is given."""
    try:
        low, high = chest_range(letter, sex)
    except InputError as e:
        raise InputError(e.problem, where=document.where(("size",)), hint=e.hint) from None
    given = values.get("chest_girth", values.get("bust_girth"))
    if given is None:
        return {**values, "chest_girth": (low + high) / 2}
    if not low <= given <= high:
        problem = f"size {letter} is a chest of {low:.2f} to {high:.2f} m, but a chest of {given:.3f} m is given"
        raise InputError(problem, where=document.where(("size",)), hint="give only one of the two")
    return values


def write_measurements(path: Path, measurements: Measurements) -> None:
    """Write measurements in metres, in a form that `read_measurements` reads."""
    record = {"sex": measurements.sex, "unit": "m", "measurements": dict(measurements.values)}
    write_json(path, {**record, "sigmas": dict(measurements.sigmas), "caveats": list(measurements.caveats)})


def read_silhouettes(source: Path | Mapping[str, Any]) -> Silhouettes:
    """Find front and side photos and the stature.

    Args:
        source: A folder with front.*, side.* and stature.yaml, or a mapping {front: path, side: path, stature: metres}.

    Raises:
        InputError: something is missing, no picture, turned by EXIF, or no body's height.
    """
    if isinstance(source, Mapping):
        document = _document(source)
        if set(document.data) != {"front", "side", "stature"}:
            problem = f"silhouettes hold {', '.join(map(str, document.data))}; expected front, side, stature"
            raise InputError(problem, where=str(document.path))
        front, side, stature = Path(document.data["front"]), Path(document.data["side"]), document.data["stature"]
        if not isinstance(stature, int | float):
            raise InputError(f"stature is {stature!r}; expected metres, such as 1.72", where=str(document.path))
    else:
        folder = check_folder(Path(source))
        front, side = (_view(folder, name) for name in ("front", "side"))
        stored: StatureFile = check_schema(_document(folder / "stature.yaml"), StatureFile, error=InputError)
        stature = stored.stature * LENGTH_M[stored.unit]
    orientation = check_images((front, side))["orientations"]
    for path, code in zip((front, side), orientation, strict=True):
        if code != 1:
            problem = f"EXIF marks the picture as rotated (orientation {code}); expected it stored upright"
            raise InputError(problem, where=str(path), hint="rotate it in an image editor and save it")
    try:
        return Silhouettes(front, side, float(stature))
    except InputError as e:
        raise InputError(e.problem, where=str(front.parent), hint=e.hint) from None


def write_landmarks(path: Path, landmarks: Mapping[str, FloatArray]) -> None:
    """Write landmarks, name -> position [m], shape (3,)."""
    write_json(path, {name: np.asarray(position) for name, position in landmarks.items()})


def read_landmarks(path: Path) -> dict[str, FloatArray]:
    """Read landmarks, name -> position [m], shape (3,).

    Raises:
        FormatError: not what `write_landmarks` wrote.
    """
    try:
        return {name: np.array(position, dtype=np.float64).reshape(3) for name, position in read_json(path).items()}
    except (AttributeError, TypeError, ValueError) as e:
        raise FormatError(f"not a table of points: {e}", where=str(path)) from None


def _view(folder: Path, name: str) -> Path:
    found = [path for path in listed(folder, SUFFIXES) if path.stem.lower() == name]
    if len(found) != 1:
        raise InputError(f"{len(found)} pictures named {name}; expected one, as PNG, JPEG or TIFF", where=str(folder))
    return found[0]


def _document(source: Path | Mapping[str, Any]) -> Document:
    if isinstance(source, Mapping):
        return Document(dict(source), Path("the document"))
    return load_yaml(Path(source), error=InputError)
