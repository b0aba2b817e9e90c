"""Cloth with softer threads: it comes nearly to rest in few steps, and has little left to do as it is.

Threads hardly stretch, so a fold that travels does so along a curved way. A Newton step is straight: by going δ across
a radius R it stretches threads by about δ²/2R², so the stiffer they are the shorter it has to be. With a tenth of the
stiffness it is three times as long. On a coarse mesh, whose triangles cannot bend, softer threads make up for some of
that. What is tight must not give, or it slips from where friction would hold it: so threads are only soft up to a
strain that would move a hem by millimetres, and as stiff as ever beyond. Stiffness continuation is known from
nonlinear elasticity (Allgower & Georg 1990, ch. 2).
"""

from __future__ import annotations

from dataclasses import replace

from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.model.fabric import Fabric, StretchCurve

_SHARE = 0.1  # of the stiffness of warp and weft; shear is soft as it is
_UP_TO = 0.005  # strain of a thread


def softened(fabric: Fabric, config: DrapeConfig) -> tuple[Fabric, DrapeConfig]:
    """Return the fabric with softer threads, and settings that make them as stiff as they are beyond a small strain."""
    limit, beyond = config.strain_limit, 1.0
    if limit is not None and limit <= _UP_TO:
        beyond += config.beyond_limit
    soft = replace(
        fabric,
        stretch_warp=_SHARE * fabric.stretch_warp,
        stretch_weft=_SHARE * fabric.stretch_weft,
        curve_warp=_softer(fabric.curve_warp),
        curve_weft=_softer(fabric.curve_weft),
    )
    within = _UP_TO if limit is None else min(limit, _UP_TO)
    return soft, config.model_copy(update={"strain_limit": within, "beyond_limit": beyond / _SHARE - 1.0})


def _softer(curve: StretchCurve | None) -> StretchCurve | None:
    return None if curve is None else replace(curve, tension=tuple(_SHARE * one for one in curve.tension))
