"""Complete a fabric from the values in a file: what is derived, what is assumed, and why."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from vto_pipeline.io.fabric_formats.curves import WEAR_TENSION, secant_stiffness
from vto_pipeline.model.fabric import Fabric, StretchCurve
from vto_pipeline.units import GRAVITY


@dataclass(frozen=True)
class Figures:
    """The values of a fabric in a file, in SI.

    Args:
        name: For people.
        source: Where the figures come from.
        values: Field of `Fabric` -> figure; None where the file has none.
        curves: "curve_warp" and "curve_weft" -> measured stretch, those that there are.
        guessed: Fields of `values` that the file itself calls assumed.
        derived: How figures were worked out from others.
    """

    name: str
    source: str
    values: Mapping[str, float | None]
    curves: Mapping[str, StretchCurve] = field(default_factory=dict)
    guessed: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()


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
        "the mean of four woven fabrics of Penava et al. 2014 (0.07 to 0.38)",
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
    "friction": Assumption(lambda known: 0.3, "a middle value; no source consulted gives one for cloth on skin"),
    "stretch_hysteresis": Assumption(
        lambda known: 0.11 * WEAR_TENSION,
        "0.11 of the tension, the geometric mean of eight loops along the threads of the two fabrics measured in the "
        "examples of the U3M format (0.07 to 0.17)",
    ),
    "shear_hysteresis": Assumption(lambda known: 0.0, "no loss; no source consulted relates 2HG to other figures"),
    "damping": Assumption(
        lambda known: 1e-3, "1 ms, which takes 1.6 % of critical from a swing of 5 Hz; no source consulted gives one"
    ),
}
"""Field of `Fabric` -> how it is assumed, in the order in which they are filled in."""


def complete_fabric(found: Figures) -> Fabric:
    """Return the fabric: curves give the stiffness of linear models and how far threads were tested.

    `ASSUMED` gives what is still missing, but for what threads are known to bear: that is not known then.
    """
    known = {name: value for name, value in found.values.items() if value is not None}
    derived = list(found.derived)
    for name, curve in found.curves.items():
        stretch = name.replace("curve", "stretch")
        if stretch not in known:
            known[stretch], tension = secant_stiffness(curve)
            derived.append(f"{stretch}: secant of {name} from 0 to {tension:.3g} N/m")
        known.setdefault(name.replace("curve", "elongation"), curve.strain[-1])
    filled = tuple(name for name in ASSUMED if name not in known)
    for name in filled:
        known[name] = ASSUMED[name].value(known)
    return Fabric(
        name=found.name,
        source=found.source,
        assumed=(*found.guessed, *filled),
        curve_warp=found.curves.get("curve_warp"),
        curve_weft=found.curves.get("curve_weft"),
        derived=tuple(derived),
        **known,  # type: ignore[arg-type]  # fields of figures only
    )


_SHOWN: dict[str, tuple[float, str]] = {
    "areal_density": (1e3, "g/m²"),
    "thickness": (1e3, "mm"),
    "stretch_warp": (1.0, "N/m"),
    "stretch_weft": (1.0, "N/m"),
    "shear": (1.0, "N/m"),
    "poisson": (1.0, ""),
    "bending_warp": (1e6, "µN·m"),
    "bending_weft": (1e6, "µN·m"),
    "bending_hysteresis": (1e3, "mN"),
    "friction": (1.0, ""),
    "stretch_hysteresis": (1.0, "N/m"),
    "shear_hysteresis": (1.0, "N/m"),
    "damping": (1e3, "ms"),
}
"""Field of `Fabric` -> factor from SI and unit in which people read it."""


def assumption_notes(fabric: Fabric) -> tuple[str, ...]:
    """Return notes for the user: which values of a fabric were assumed, and how others were derived."""
    figures = [
        f"{name} {getattr(fabric, name) * factor:.3g} {unit}".rstrip()
        for name, (factor, unit) in _SHOWN.items()
        if name in fabric.assumed
    ]
    assumed = (f"{fabric.name}: assumed, not measured: {', '.join(figures)}",) if figures else ()
    return (*assumed, *(f"{fabric.name}: {line}" for line in fabric.derived))
