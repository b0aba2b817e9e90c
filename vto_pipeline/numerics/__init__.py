"""Numerical kernels that follow the papers: arrays in, arrays out.

vector, planar, distance: three-vectors, plane points, nearest points
plane_curves: polylines, Bezier curves and arcs
ccd, separation: continuous collision detection
line_search: how much of a descent step to take
rasterise, resample: the visible triangle of each pixel; values of a picture between its pixels
solids, volume: signed distance to solids with a formula; what a surface encloses
kinematics: skeletons over many frames
srgb: bytes of pictures and linear light
linear/, spatial/, mechanics/: linear algebra, what is near what, formulas of one stencil
cpu_threads, kernel_cache: threads of the processor; where compiled kernels are kept
"""

from __future__ import annotations

from vto_pipeline.numerics.cpu_threads import load_tbb
from vto_pipeline.numerics.kernel_cache import (
    leave_out_c_entries,
    serialise_cache_writes,
    take_turns_compiling,
    use_kernel_cache,
)

use_kernel_cache()
serialise_cache_writes()
take_turns_compiling()
leave_out_c_entries()
load_tbb()
