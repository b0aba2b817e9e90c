"""The package's own fabric file: its keys and their conversion to SI."""

from __future__ import annotations

from math import radians
from typing import Annotated

from pydantic import Field

from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.io.documents import Document, check_schema, suggest
from vto_pipeline.io.fabric_formats.assumed import Figures
from vto_pipeline.model.fabric import StretchCurve
from vto_pipeline.model.settings import Config
from vto_pipeline.units import GSM

_Strain = Annotated[float, Field(ge=0, le=10)]
_Tension = Annotated[float, Field(ge=0, le=1e6)]
_Points = Annotated[list[tuple[_Strain, _Tension]], Field(min_length=1, max_length=1000)]


class MembraneFile(Config):
    """In-plane stiffness."""

    warp: float | None = Field(default=None, gt=0, le=1e7, description="Warp force per width and strain [N/m]")
    weft: float | None = Field(default=None, gt=0, le=1e7, description="Weft force per width and strain [N/m]")
    shear: float | None = Field(default=None, gt=0, le=1e7, description="Shear stiffness [N/m]")
    poisson: float | None = Field(default=None, gt=-0.99, lt=0.99, description="Poisson's ratio, warp-weft")
    curve_warp: _Points | None = Field(default=None, description="Rising [[strain, N/m], ...] of a tensile test")
    curve_weft: _Points | None = Field(default=None, description="Rising [[strain, N/m], ...] of a tensile test")
    hysteresis: float | None = Field(
        default=None, ge=0, le=1e4, description="Tension lost to friction at a garment's own weight [N/m]"
    )
    shear_hysteresis: float | None = Field(default=None, ge=0, le=1e4, description="2HG, shear force lost [N/m]")
    elongation_warp: float | None = Field(
        default=None, gt=0, le=10, description="Stretch that the warp is known to bear; by default its curve's end"
    )
    elongation_weft: float | None = Field(
        default=None, gt=0, le=10, description="Stretch that the weft is known to bear; by default its curve's end"
    )
    shear_angle_deg: float | None = Field(
        default=None, gt=0, le=90, description="Angle by which threads are known to bear being sheared [degrees]"
    )


class BendingFile(Config):
    """Out-of-plane stiffness."""

    warp: float | None = Field(default=None, ge=0, le=1, description="Warp rigidity per width [N·m]")
    weft: float | None = Field(default=None, ge=0, le=1, description="Weft rigidity per width [N·m]")
    hysteresis: float | None = Field(
        default=None, ge=0, le=10, description="2HB, moment per width lost to friction [N]"
    )


class FabricFile(Config):
    """A fabric file; everything but the mass may be absent."""

    name: str = Field("fabric", max_length=200, description="Name to display")
    areal_density_gsm: float = Field(ge=1, le=5000, description="Mass per area [g/m²]")
    thickness_mm: float | None = Field(default=None, gt=0, le=50, description="Thickness [mm]")
    membrane: MembraneFile = Field(default_factory=MembraneFile, description="In-plane stiffness")
    bending: BendingFile = Field(default_factory=BendingFile, description="Out-of-plane stiffness")
    friction: float | None = Field(default=None, ge=0, le=5, description="Coulomb friction against skin and itself")
    damping_s: float | None = Field(default=None, ge=0, le=10, description="Rayleigh damping β of stiffness [s]")
    source: str = Field("", max_length=2000, description="Where the figures come from")
    assumed: list[str] = Field(
        default_factory=list, max_length=20, description="Fields of Fabric that were assumed, not measured"
    )


def read_document(document: Document) -> Figures:
    """Convert a fabric file.

    Raises:
        ConfigError: an unknown key (with its line), a value out of range, a curve that does not rise.
    """
    stored: FabricFile = check_schema(document, FabricFile)
    angle = stored.membrane.shear_angle_deg
    values = {
        "areal_density": stored.areal_density_gsm * GSM,
        "thickness": None if stored.thickness_mm is None else stored.thickness_mm / 1000,
        "stretch_warp": stored.membrane.warp,
        "stretch_weft": stored.membrane.weft,
        "shear": stored.membrane.shear,
        "poisson": stored.membrane.poisson,
        "bending_warp": stored.bending.warp,
        "bending_weft": stored.bending.weft,
        "bending_hysteresis": stored.bending.hysteresis,
        "friction": stored.friction,
        "stretch_hysteresis": stored.membrane.hysteresis,
        "shear_hysteresis": stored.membrane.shear_hysteresis,
        "damping": stored.damping_s,
        "elongation_warp": stored.membrane.elongation_warp,
        "elongation_weft": stored.membrane.elongation_weft,
        "shear_angle": None if angle is None else radians(angle),
    }
    given = sorted(name for name, value in values.items() if value is not None)
    for index, name in enumerate(stored.assumed):
        if name not in given:
            problem = f"assumed: {name} is not a value in this file"
            raise ConfigError(problem, where=document.where(("assumed", index)), hint=suggest(name, given))
    curves = {
        name: _curve(points, document, name)
        for name in ("curve_warp", "curve_weft")
        if (points := getattr(stored.membrane, name)) is not None
    }
    return Figures(stored.name, stored.source, values, curves, tuple(stored.assumed))


def _curve(points: list[tuple[float, float]], document: Document, name: str) -> StretchCurve:
    """Return the points as a curve, with the origin added if it is missing."""
    if points[0] != (0.0, 0.0):
        points = [(0.0, 0.0), *points]
    strain, tension = zip(*points, strict=True)
    try:
        return StretchCurve(strain, tension)
    except InputError as e:
        raise ConfigError(f"membrane.{name}: {e.problem}", where=document.where(("membrane", name))) from None
