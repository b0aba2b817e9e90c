"""Fabrics, in SI units."""

from __future__ import annotations

from dataclasses import dataclass

from vto_pipeline.errors import InputError


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
        assumed: Names of the fields that were not given and were filled in.
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

    def __post_init__(self) -> None:
        for name in ("areal_density", "thickness", "stretch_warp", "stretch_weft", "shear"):
            if not 0 < getattr(self, name) < 1e9:
                raise InputError(f"fabric {self.name}: {name} is {getattr(self, name)}; wanted a positive number")
        for name in ("bending_warp", "bending_weft", "bending_hysteresis", "friction"):
            if not 0 <= getattr(self, name) < 1e9:
                raise InputError(f"fabric {self.name}: {name} is {getattr(self, name)}; wanted zero or more")
        if not -0.99 < self.poisson < 0.99:
            raise InputError(f"fabric {self.name}: poisson is {self.poisson}; wanted -0.99 to 0.99")
