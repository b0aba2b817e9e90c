"""Everything that resists deformation: one kind a file, listed here."""

from __future__ import annotations

from vto_pipeline.cloth.constraints import (
    bend,
    bend_friction,
    combination,
    curve,
    green,
    shape_operator,
    spring,
    strain_friction,
    strain_limit,
    stretch,
)

KINDS = (
    bend.KIND,
    bend_friction.KIND,
    combination.KIND,
    curve.KIND,
    green.KIND,
    shape_operator.KIND,
    spring.KIND,
    strain_friction.KIND,
    strain_limit.KIND,
    stretch.KIND,
)
