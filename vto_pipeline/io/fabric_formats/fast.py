"""FAST, Fabric Assurance by Simple Testing (CSIRO): the figures of FAST-1 to FAST-3 to SI.

De Boos & Tester 1994, "SiroFAST: fabric assurance by simple testing", CSIRO report WT92.02.
"""

from __future__ import annotations

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import Document
from vto_pipeline.io.fabric_formats.assumed import Figures
from vto_pipeline.io.fabric_formats.curves import GRAM_FORCE
from vto_pipeline.io.fabric_formats.sheets import FabricSheet, Parameter, read_sheet, require
from vto_pipeline.model.fabric import StretchCurve
from vto_pipeline.units import GRAVITY

_MILLIMETRES = {"mm": 1e-3}
_PERCENT = {"%": 0.01}

PARAMETERS = {
    "W": Parameter("mass per area", {"g/m²": 1e-3, "mg/cm²": 0.01}, 1, 5000, directed=False),
    "T2": Parameter("thickness at 2 gf/cm²", _MILLIMETRES, 0.01, 50, directed=False),
    "T100": Parameter("thickness at 100 gf/cm²", _MILLIMETRES, 0.01, 50, directed=False),
    "ST": Parameter("surface thickness", _MILLIMETRES, 0, 50, directed=False),
    "STR": Parameter("released surface thickness", _MILLIMETRES, 0, 50, directed=False),
    "C": Parameter("bending length", _MILLIMETRES, 1, 200),
    "B": Parameter("bending rigidity", {"µN·m": 1e-6, "gf·cm²/cm": GRAM_FORCE * 0.01}, 1e-3, 1e4),
    "E5": Parameter("extension at 5 gf/cm", _PERCENT, 0, 100),
    "E20": Parameter("extension at 20 gf/cm", _PERCENT, 0, 200),
    "E100": Parameter("extension at 100 gf/cm", _PERCENT, 0, 300),
    "EB5": Parameter("bias extension at 5 gf/cm", _PERCENT, 0.01, 100, directed=False),
    "G": Parameter("shear rigidity", {"N/m": 1.0}, 0.1, 1e5, directed=False),
    "F": Parameter("formability", {"mm²": 1e-6}, 0, 1000),
    "RS": Parameter("relaxation shrinkage", _PERCENT, -50, 50),
    "HE": Parameter("hygral expansion", _PERCENT, -50, 50),
}
"""Name on the sheet -> unit and meaning. T100, ST, STR, F, RS and HE are read, checked, and not used."""

_LOADS = {"E5": 5 * GRAM_FORCE / 0.01, "E20": 20 * GRAM_FORCE / 0.01, "E100": 100 * GRAM_FORCE / 0.01}  # [N/m]


def read_fast(document: Document) -> Figures:
    """Convert a FAST sheet.

    Raises:
        InputError: as `read_sheet`; no W; a lighter load that stretches more.
    """
    sheet = read_sheet(document, PARAMETERS)
    require(sheet, "W", PARAMETERS, document.path)
    values = {"areal_density": sheet.mean("W"), "thickness": sheet.mean("T2"), "shear": sheet.mean("G")}
    curves: dict[str, StretchCurve] = {}
    derived = []
    for direction, name in enumerate(("warp", "weft")):
        rigidity, length = sheet.along("B", direction), sheet.along("C", direction)
        if rigidity is None and length is not None:
            rigidity = sheet.values["W"][0] * GRAVITY * length**3
            derived.append(f"bending_{name}: W g C³")
        values[f"bending_{name}"] = rigidity
        curve = _curve(sheet, direction, document)
        if curve is not None:
            curves[f"curve_{name}"] = curve
    bias = sheet.mean("EB5")
    if values["shear"] is None and bias is not None:
        values["shear"] = _LOADS["E5"] / (4 * bias)
        derived.append("shear: a bias strip's tension / (4 strain) at 5 gf/cm, the instrument's 123 / EB5")
    return Figures(sheet.name, sheet.source, values, curves, derived=tuple(derived))


def _curve(sheet: FabricSheet, direction: int, document: Document) -> StretchCurve | None:
    """The extensions at the three loads as a curve; None where nothing stretched.

    From the heaviest load down, so that of equal extensions, which the dial rounds to, the heaviest load counts.
    """
    points: list[tuple[float, float]] = []
    for key, tension in sorted(_LOADS.items(), key=lambda item: -item[1]):
        extension = sheet.along(key, direction)
        if extension is None:
            continue
        if points and extension > points[-1][0]:
            raise InputError(f"{key}: larger than at a heavier load", where=document.where((key,)))
        if extension > 0.0 and (not points or extension < points[-1][0]):
            points.append((extension, tension))
    if not points:
        return None
    rising = [(0.0, 0.0), *reversed(points)]
    return StretchCurve(tuple(strain for strain, _ in rising), tuple(tension for _, tension in rising))
