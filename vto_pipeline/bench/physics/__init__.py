"""Cloth against mechanics: shapes, modes, buckling loads and drape coefficients.

closed_forms, elastica: what mechanics says
cantilever, buckling, cusick, hanging, modes: the scenes
refinement: the order of convergence of one scene
swatch/: rigidity measured from strips of known rigidity
"""

from __future__ import annotations

from collections.abc import Iterator

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.physics.buckling import buckling_rows
from vto_pipeline.bench.physics.cantilever import cantilever_rows
from vto_pipeline.bench.physics.cusick import cusick_rows
from vto_pipeline.bench.physics.hanging import hanging_rows
from vto_pipeline.bench.physics.modes import mode_rows


def rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Measure all of them. Errors are relative ("_share"); "order" is that of convergence from the row before."""
    for part in (hanging_rows, cantilever_rows, mode_rows, buckling_rows, cusick_rows):
        yield from part(quick, watch)


TRADE = "one formulation on finer and finer meshes; how fine a mesh is, the garment decides"
