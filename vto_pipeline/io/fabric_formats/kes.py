"""KES-FB, the Kawabata Evaluation System: a sheet's 16 parameters to SI.

Kawabata 1980, "The standardization and analysis of hand evaluation", 2nd edition.
"""

from __future__ import annotations

from math import pi

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import Document
from vto_pipeline.io.fabric_formats.assumed import Figures
from vto_pipeline.io.fabric_formats.curves import GRAM_FORCE, WEAR_TENSION, power_law
from vto_pipeline.io.fabric_formats.sheets import FabricSheet, Parameter, read_sheet, require
from vto_pipeline.model.fabric import StretchCurve

_PER_WIDTH = {"gf/cm": GRAM_FORCE / 0.01, "cN/cm": 1.0, "N/m": 1.0}
_ENERGY = {"gf·cm/cm²": GRAM_FORCE / 0.01, "cN·cm/cm²": 1.0, "J/m²": 1.0}
_PER_RADIAN = 180 / pi
_PERCENT = {"%": 0.01}
_NO_UNIT = {"-": 1.0}
_MILLIMETRES = {"mm": 1e-3}

PARAMETERS = {
    "W": Parameter("mass per area", {"mg/cm²": 0.01, "g/m²": 1e-3}, 0.1, 500, directed=False),
    "T0": Parameter("thickness at 0.5 gf/cm²", _MILLIMETRES, 0.01, 50, directed=False),
    "TM": Parameter("thickness at 50 gf/cm²", _MILLIMETRES, 0.01, 50, directed=False),
    "LT": Parameter("linearity of stretch", _NO_UNIT, 0.2, 1.5),
    "WT": Parameter("energy of stretch", _ENERGY, 1e-3, 1000),
    "RT": Parameter("recovery from stretch", _PERCENT, 0, 100),
    "EMT": Parameter("extension at Fmax", _PERCENT, 0.05, 300),
    "Fmax": Parameter("greatest tension of the test", _PER_WIDTH, 1, 5000, directed=False),
    "G": Parameter(
        "shear stiffness",
        {"gf/(cm·deg)": GRAM_FORCE / 0.01 * _PER_RADIAN, "cN/(cm·deg)": _PER_RADIAN, "N/m": 1.0},
        0.001,
        100,
    ),
    "2HG": Parameter("hysteresis of shear at 0.5°", _PER_WIDTH, 0, 1000),
    "2HG5": Parameter("hysteresis of shear at 5°", _PER_WIDTH, 0, 1000),
    "B": Parameter("bending rigidity", {"gf·cm²/cm": GRAM_FORCE * 0.01, "cN·cm²/cm": 1e-4, "µN·m": 1e-6}, 1e-5, 100),
    "2HB": Parameter("hysteresis of bending", {"gf·cm/cm": GRAM_FORCE, "cN·cm/cm": 0.01, "mN": 1e-3}, 0, 100),
    "LC": Parameter("linearity of compression", _NO_UNIT, 0, 2, directed=False),
    "WC": Parameter("energy of compression", _ENERGY, 0, 1000, directed=False),
    "RC": Parameter("recovery from compression", _PERCENT, 0, 100, directed=False),
    "MIU": Parameter("friction", _NO_UNIT, 0, 5),
    "MMD": Parameter("deviation of friction", _NO_UNIT, 0, 5),
    "SMD": Parameter("roughness", {"µm": 1e-6}, 0, 1000),
}
"""Name on the sheet -> unit and meaning. Compression, MMD, SMD and 2HG5 are read, checked, and not used."""

_STANDARD_TENSION = 500 * GRAM_FORCE / 0.01  # [N/m]
_AGREE = 0.25  # of LT: sheets print it with two figures, and average several specimens


def read_kes(document: Document) -> Figures:
    """Convert a KES-FB sheet.

    Raises:
        InputError: as `read_sheet`; no W; LT, WT and EMT that contradict each other.
    """
    sheet = read_sheet(document, PARAMETERS)
    require(sheet, "W", PARAMETERS, document.path)
    values = {
        "areal_density": sheet.mean("W"),
        "thickness": sheet.mean("T0"),
        "shear": sheet.mean("G"),
        "shear_hysteresis": sheet.mean("2HG"),
        "bending_warp": sheet.along("B", 0),
        "bending_weft": sheet.along("B", 1),
        "bending_hysteresis": sheet.mean("2HB"),
        "friction": sheet.mean("MIU"),
    }
    derived = [] if values["friction"] is None else ["friction: MIU, against the instrument's steel contactor"]
    curves: dict[str, StretchCurve] = {}
    lost: list[float] = []
    if "EMT" in sheet.values:
        tension = sheet.mean("Fmax") or _STANDARD_TENSION
        for direction, name in enumerate(("warp", "weft")):
            extension, linearity = sheet.values["EMT"][direction], _linearity(sheet, direction, tension, document)
            values[f"elongation_{name}"] = extension
            if linearity is None:
                values[f"stretch_{name}"] = tension / extension
                derived.append(f"stretch_{name}: secant from 0 to {tension:.3g} N/m")
                continue
            curves[f"curve_{name}"] = power_law(extension, tension, linearity)
            derived.append(f"curve_{name}: a power law with the sheet's extension and energy")
            if "RT" in sheet.values:
                lost.append(linearity / 2 * (1 - sheet.values["RT"][direction]))
    if lost:
        values["stretch_hysteresis"] = WEAR_TENSION * sum(lost) / len(lost)
        derived.append(f"stretch_hysteresis: LT (1 - RT) / 2 of a tension of {WEAR_TENSION:.3g} N/m")
    return Figures(sheet.name, sheet.source, values, curves, derived=tuple(derived))


def _linearity(sheet: FabricSheet, direction: int, tension: float, document: Document) -> float | None:
    """Return LT, or derive it from WT and EMT; None if these are missing too."""
    stated, energy = sheet.along("LT", direction), sheet.along("WT", direction)
    if energy is None:
        return stated
    found = energy / (0.5 * tension * sheet.values["EMT"][direction])
    least, most = PARAMETERS["LT"].low, PARAMETERS["LT"].high
    if not least <= found <= most or (stated is not None and abs(found - stated) > _AGREE * stated):
        wanted = f"{least:g} to {most:g}" if stated is None else f"LT, {stated:g}"
        problem = f"WT / (½ Fmax EMT) is {found:.3g}; expected {wanted}"
        raise InputError(problem, where=document.where(("WT",)), hint="is a unit wrong, or Fmax not 500 gf/cm?")
    return found if stated is None else stated
