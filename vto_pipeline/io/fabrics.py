"""Fabrics: the presets, and files of measured figures in the trade's units, converted to SI at the door.

What a file leaves out is filled in from the table `ASSUMED` and named in `Fabric.assumed`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.documents import Document, check_schema, load_yaml, suggest
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.settings import Config
from vto_pipeline.units import GRAVITY, GSM

_PRESETS = Path(__file__).parent / "fabric_presets"
_SUFFIXES = (".yaml", ".yml", ".json")


class MembraneFile(Config):
    """In-plane stiffness."""

    warp: float | None = Field(default=None, gt=0, le=1e7, description="Force per width and strain [N/m].")
    weft: float | None = Field(default=None, gt=0, le=1e7, description="Force per width and strain [N/m].")
    shear: float | None = Field(default=None, gt=0, le=1e7, description="[N/m]")
    poisson: float | None = Field(default=None, gt=-0.99, lt=0.99, description="Warp-weft, dimensionless.")


class BendingFile(Config):
    """Out-of-plane stiffness."""

    warp: float | None = Field(default=None, ge=0, le=1, description="Rigidity per width [N·m].")
    weft: float | None = Field(default=None, ge=0, le=1, description="Rigidity per width [N·m].")
    hysteresis: float | None = Field(
        default=None, ge=0, le=10, description="2HB, moment per width lost to friction [N]."
    )


class FabricFile(Config):
    """A fabric file; everything but the mass may be absent."""

    name: str = Field("fabric", max_length=200, description="For people.")
    areal_density_gsm: float = Field(ge=1, le=5000, description="Mass per area [g/m²].")
    thickness_mm: float | None = Field(default=None, gt=0, le=50, description="[mm]")
    membrane: MembraneFile = Field(default_factory=MembraneFile, description="In-plane stiffness.")
    bending: BendingFile = Field(default_factory=BendingFile, description="Out-of-plane stiffness.")
    friction: float | None = Field(default=None, ge=0, le=5, description="Coulomb coefficient against skin and itself.")
    source: str = Field("", max_length=2000, description="Where the figures come from.")


@dataclass(frozen=True)
class Assumption:
    """How a missing figure is filled in.

    Args:
        value: Figures known so far, in SI -> the assumed one.
        reason: Why this one.
    """

    value: Callable[[Mapping[str, float]], float]
    reason: str


def _by_bending_length(known: Mapping[str, float]) -> float:
    return known["areal_density"] * GRAVITY * 0.019**3


ASSUMED: dict[str, Assumption] = {
    "thickness": Assumption(
        lambda known: known["areal_density"] / 450.0,
        "450 kg/m³, the median bulk density of 16 apparel fabrics with published mass and thickness (249 to 653)",
    ),
    "stretch_warp": Assumption(
        lambda known: known.get("stretch_weft", 1860.0),
        "as the weft; else 1860 N/m, the geometric mean of three wovens measured at low force (588 to 6571)",
    ),
    "stretch_weft": Assumption(
        lambda known: min(known["stretch_warp"], 1080.0),
        "1080 N/m, the geometric mean of the same three wovens (338 to 3560), but no more than the warp",
    ),
    "shear": Assumption(
        lambda known: min(50.0, 0.5 * known["stretch_weft"]),
        "50 N/m, the middle of the FAST working range for suitings (30 to 80), but at most half the weft's stretch",
    ),
    "poisson": Assumption(
        lambda known: 0.24,
        "the mean of four fabrics in the inputs of Li, Kaufman and Jiang 2021, Codimensional IPC (0.07 to 0.38)",
    ),
    "bending_warp": Assumption(
        lambda known: known.get("bending_weft", _by_bending_length(known)),
        "as the weft; else a bending length (Peirce 1930) of 19 mm, the geometric mean of seven wovens (12 to 25 mm)",
    ),
    "bending_weft": Assumption(lambda known: known["bending_warp"], "as the warp"),
    "bending_hysteresis": Assumption(
        lambda known: 50.0 * 0.5 * (known["bending_warp"] + known["bending_weft"]),
        "2HB / B = 50 1/m, the geometric mean of the four fabrics of Matsudaira et al. 2015 (37 to 105)",
    ),
    "friction": Assumption(lambda known: 0.3, "a middle value; no source read gives one for cloth on skin"),
}
"""Field of `Fabric` -> how it is assumed, in the order in which they are filled in."""


def read_fabric(fabric: str | Path | Mapping[str, Any]) -> Fabric:
    """Read a preset by name, a fabric file, or the same keys as a mapping.

    Args:
        fabric: Name of a preset, path of a YAML file, or a mapping.

    Returns:
        The fabric in SI; `assumed` names what was filled in.

    Raises:
        ConfigError: no such preset or file, an unknown key (with its line), or a value out of range.
    """
    if isinstance(fabric, Mapping):
        return _fabric(Document(dict(fabric), Path("the document")))
    path = Path(fabric)
    if path.suffix.lower() not in _SUFFIXES:
        names = preset_names()
        if str(fabric) not in names:
            problem = f"{str(fabric)!r} is neither a preset nor a .yaml file"
            raise ConfigError(problem, where="fabric", hint=suggest(str(fabric), names))
        path = _PRESETS / f"{fabric}.yaml"
    return _fabric(load_yaml(path))


def preset_names() -> tuple[str, ...]:
    """Names of the presets, sorted."""
    return tuple(sorted(path.stem for path in _PRESETS.glob("*.yaml")))


def _fabric(document: Document) -> Fabric:
    """Convert to SI and fill in."""
    stored: FabricFile = check_schema(document, FabricFile)
    given = {
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
    }
    known = {name: value for name, value in given.items() if value is not None}
    assumed = tuple(name for name in ASSUMED if name not in known)
    for name in assumed:
        known[name] = ASSUMED[name].value(known)
    return Fabric(name=stored.name, source=stored.source, assumed=assumed, **known)
