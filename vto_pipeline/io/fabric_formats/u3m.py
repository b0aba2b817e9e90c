"""U3M, the Unified 3D Material (vizoogmbh/u3m, version 1.1): physics, and raw data of a fabric analyser.

A .u3m holds mass and thickness and names the analyser's JSON file. That file's raw part is read as its schema
describes it: each test is a list of branches, up and back in turn, each a flat list of distance [cm] and force [gf];
L, W and B are strips along, across and on the bias, S2 is stretch at a gauge of 8 cm.

Not read: the `custom` section, which U3M forbids to all but its vendor; the bending loops D1, D2 and U1 and the
thickness test T, whose evaluation is not documented; S1, where the clamps of a gauge of 2 cm hold the strip's shear
back; and .u3ma archives, which are to be unpacked first.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.documents import Document, check_schema
from vto_pipeline.io.fabric_formats.assumed import Figures
from vto_pipeline.io.fabric_formats.curves import (
    GRAM_FORCE,
    WEAR_TENSION,
    hysteresis_share,
    measured_curve,
    trellis_angle,
)
from vto_pipeline.io.files import check_file
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import StretchCurve
from vto_pipeline.units import GSM

_BYTES = 20_000_000  # the published examples have 0.3 and 0.9 million
_NO_FILE = "null"  # so the format writes it
_Number = Annotated[float, Field(ge=-1e6, le=1e6)]
_Branch = Annotated[list[_Number], Field(max_length=200_000)]


class _Foreign(BaseModel):
    """A part of a foreign format; unknown keys are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class StretchTest(_Foreign):
    """S2, the stretch test of one direction."""

    width: float = Field(gt=0, le=100, description="Of the strip [cm]")
    length: float = Field(gt=0, le=100, description="Gauge [cm]")
    samplesTree: list[_Branch] = Field(min_length=2, max_length=64, description="Distance [cm], force [gf], ...")


class Strip(_Foreign):
    """The tests of one direction."""

    S2: StretchTest = Field(description="Stretch at a gauge of 8 cm")


class RawData(_Foreign):
    """Measurements of the analyser."""

    L: Strip = Field(description="Along the length, the warp")
    W: Strip = Field(description="Along the width, the weft")
    B: Strip = Field(description="On the bias")
    M: float = Field(ge=1, le=5000, description="Mass per area [g/m²]")


class AnalyserFile(_Foreign):
    """The file of raw data."""

    schema_: Literal["1.1"] = Field(alias="schema", description="Version")
    raw_data: RawData | None = Field(description="Null where only a vendor's own figures were stored")


class Devices(_Foreign):
    """Files of instruments."""

    fab: str = Field(_NO_FILE, max_length=255, description="Path of the analyser's file")


class Physics(_Foreign):
    """The common section of a material."""

    thickness: float | None = Field(None, gt=0, le=50, description="[mm]")
    weight: float | None = Field(None, ge=1, le=5000, description="[g/m²]")
    devices: Devices = Field(Devices(fab=_NO_FILE), description="Files of instruments")


class Material(_Foreign):
    """The parts of a material that this package uses."""

    name: str = Field("fabric", max_length=1000, description="Name to display")
    physics: Physics | None = Field(description="Null where only the look was stored")


class MaterialFile(_Foreign):
    """A .u3m file."""

    schema_: Literal["1.1"] = Field(alias="schema", description="Version")
    material: Material = Field(description="The material")


def load_u3m(path: Path) -> Document:
    """Read the JSON of a .u3m file or of an analyser's file.

    Raises:
        InputError: no such file; FormatError: not JSON.
    """
    path = check_file(Path(path), {".u3m", ".json"}, _BYTES)
    try:
        return Document(json.loads(path.read_text(encoding="utf-8")), path)
    except json.JSONDecodeError as e:
        raise FormatError(f"not valid JSON: {e.msg}", where=f"{path}, line {e.lineno}") from None
    except (ValueError, RecursionError) as e:
        raise FormatError(f"not valid JSON: {e}", where=str(path)) from None


def is_u3m(data: Any) -> bool:
    """Whether a document is a .u3m or an analyser's file, by its keys."""
    return isinstance(data, dict) and "schema" in data and ("material" in data or "raw_data" in data)


def read_u3m(document: Document) -> Figures:
    """Convert a material with the analyser file that it names, or an analyser file alone.

    Raises:
        InputError: a key missing or wrong, or neither a mass nor a measurement in it.
    """
    if "raw_data" in document.data:
        return _analysed(document, document.path.stem, None)
    stored: MaterialFile = check_schema(document, MaterialFile, error=InputError)
    physics = stored.material.physics
    if physics is None:
        raise InputError("material.physics is null: this file describes only a look", where=str(document.path))
    if physics.devices.fab != _NO_FILE:
        return _analysed(load_u3m(_beside(document.path, physics.devices.fab)), stored.material.name, physics)
    if physics.weight is None:
        raise InputError("material.physics has neither a weight nor a file of measurements", where=str(document.path))
    return Figures(stored.material.name, f"U3M material, {document.path.name}", _common(physics, physics.weight))


def _analysed(document: Document, name: str, physics: Physics | None) -> Figures:
    stored: AnalyserFile = check_schema(document, AnalyserFile, error=InputError)
    raw = stored.raw_data
    if raw is None:
        problem = "raw_data is null; vendor data in `custom` is not supported"
        raise InputError(problem, where=str(document.path))
    values = _common(physics, raw.M)
    curves: dict[str, StretchCurve] = {}
    lost = []
    for key, field in (("L", "curve_warp"), ("W", "curve_weft"), ("B", "")):
        test: StretchTest = getattr(raw, key).S2
        where = f"{document.path}, raw_data.{key}.S2"
        up, back = _last_cycle(test, where)
        try:
            curve = measured_curve(*up)
        except InputError as e:
            raise InputError(e.problem, where=where) from None
        if not field:
            bias = float(np.interp(WEAR_TENSION, curve.tension, curve.strain))
            values["shear"] = WEAR_TENSION / (4 * bias)
            values["shear_angle"] = trellis_angle(curve.strain[-1])
            continue
        curves[field] = curve
        strain = np.array(curve.strain)
        lost.append(hysteresis_share(strain, np.array(curve.tension), np.interp(strain, back[0][::-1], back[1][::-1])))
    values["stretch_hysteresis"] = WEAR_TENSION * sum(lost) / len(lost)
    derived = (
        f"shear: a bias strip's tension / (4 strain) at {WEAR_TENSION:.3g} N/m",
        f"stretch_hysteresis: the last loop's width over its tension, at {WEAR_TENSION:.3g} N/m",
    )
    source = f"raw data of a fabric analyser, {document.path.name}: the last cycle's loading at a gauge of 8 cm"
    return Figures(name, source, values, curves, derived=derived)


def _common(physics: Physics | None, weight: float) -> dict[str, float | None]:
    """Return mass and thickness; where both give them, the material overrides the analyser."""
    if physics is None:
        return {"areal_density": weight * GSM}
    thickness = None if physics.thickness is None else physics.thickness / 1000
    return {"areal_density": (physics.weight or weight) * GSM, "thickness": thickness}


def _last_cycle(test: StretchTest, where: str) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Return strain and tension [N/m] of the last loading branch and of the unloading branch after it."""
    branches = [np.array(branch) for branch in test.samplesTree]
    if any(len(branch) % 2 or len(branch) < 4 for branch in branches):
        raise FormatError("samplesTree: a branch needs two or more pairs of distance and force", where=where)
    rising = [branch[-2] > branch[0] for branch in branches]
    pairs = [i for i in range(len(branches) - 1) if rising[i] and not rising[i + 1]]
    if not pairs:
        raise FormatError("samplesTree: no loading branch followed by an unloading one", where=where)

    def converted(branch: FloatArray) -> tuple[FloatArray, FloatArray]:
        return branch[::2] / test.length - 1.0, branch[1::2] * GRAM_FORCE / (test.width / 100)

    return converted(branches[pairs[-1]]), converted(branches[pairs[-1] + 1])


def _beside(path: Path, relative: str) -> Path:
    """Return the file that a material names, which must lie within the material's folder."""
    named = path.parent / relative
    if "\0" in relative or not named.resolve().is_relative_to(path.parent.resolve()):
        raise InputError(f"devices.fab: {relative!r} is not a path inside the material's folder", where=str(path))
    return named
