"""Fabrics, in SI units."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import isfinite, pi

from vto_pipeline.errors import InputError


@dataclass(frozen=True)
class StretchCurve:
    """A tensile test's loading branch, from the origin.

    Args:
        strain: Strictly increasing from 0.
        tension: Force per width [N/m], strictly increasing from 0.
    """

    strain: tuple[float, ...]
    tension: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.strain) != len(self.tension) or len(self.strain) < 2:
            found = f"{len(self.strain)} strains and {len(self.tension)} tensions"
            raise InputError(f"stretch curve: {found}; expected as many of each, two at least")
        for name, values in (("strain", self.strain), ("tension", self.tension)):
            if values[0] != 0.0 or not all(low < high for low, high in pairwise(values)) or not isfinite(values[-1]):
                raise InputError(f"stretch curve: {name} must increase from 0, each value above the last")


@dataclass(frozen=True)
class Fabric:
    """An orthotropic woven or knitted fabric.

    Args:
        name: For people.
        areal_density: [kg/m²].
        thickness: [m].
        stretch_warp, stretch_weft: Membrane stiffness, force per width and strain [N/m].
        shear: Membrane shear stiffness [N/m].
        poisson: Poisson's ratio, warp-weft, dimensionless.
        bending_warp, bending_weft: Bending rigidity per width [N·m].
        bending_hysteresis: Moment per width lost to internal friction, 2HB [N].
        friction: Coulomb coefficient against skin and itself.
        source: Where the figures come from.
        assumed: Names of the fields that were not measured.
        curve_warp, curve_weft: Measured stretch, where there is one; `stretch_warp` and `stretch_weft` are then its
            equivalent for linear models.
        stretch_hysteresis: Tension lost to internal friction between loading and unloading, at the tension of a
            garment's own weight [N/m].
        shear_hysteresis: Shear force per width lost to internal friction, 2HG [N/m].
        damping: Internal viscous loss in proportion to stiffness, Rayleigh's β [s].
        derived: How figures were worked out from others, for people.
        elongation_warp, elongation_weft: Stretch that the threads are known to bear [share]: at break, at the
            heaviest load of a test, or where a published model of it locks; `source` says which. None where not known.
        shear_angle: Angle by which the threads are known to bear being sheared, to either side [rad]; None likewise.
    """

    name: str
    areal_density: float
    thickness: float
    stretch_warp: float
    stretch_weft: float
    shear: float
    poisson: float
    bending_warp: float
    bending_weft: float
    bending_hysteresis: float
    friction: float
    source: str = ""
    assumed: tuple[str, ...] = ()
    curve_warp: StretchCurve | None = None
    curve_weft: StretchCurve | None = None
    stretch_hysteresis: float = 0.0
    shear_hysteresis: float = 0.0
    damping: float = 0.0
    derived: tuple[str, ...] = ()
    elongation_warp: float | None = None
    elongation_weft: float | None = None
    shear_angle: float | None = None

    def __post_init__(self) -> None:
        for name in ("areal_density", "thickness", "stretch_warp", "stretch_weft", "shear"):
            if not 0 < getattr(self, name) < 1e9:
                raise InputError(f"fabric {self.name}: {name} is {getattr(self, name)}; expected a positive number")
        dissipation = ("bending_hysteresis", "stretch_hysteresis", "shear_hysteresis", "damping", "friction")
        for name in ("bending_warp", "bending_weft", *dissipation):
            if not 0 <= getattr(self, name) < 1e9:
                raise InputError(f"fabric {self.name}: {name} is {getattr(self, name)}; expected zero or more")
        if not -0.99 < self.poisson < 0.99:
            raise InputError(f"fabric {self.name}: poisson is {self.poisson}; expected -0.99 to 0.99")
        for name, most in (("elongation_warp", 10.0), ("elongation_weft", 10.0), ("shear_angle", 0.5 * pi)):
            if (known := getattr(self, name)) is not None and not 0 < known <= most:
                raise InputError(f"fabric {self.name}: {name} is {known}; expected above 0, at most {most:.3g}")
