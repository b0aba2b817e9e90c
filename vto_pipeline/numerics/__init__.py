"""Kernels that read like the paper: arrays in, arrays out."""

from __future__ import annotations

from vto_pipeline.numerics.kernel_cache import use_kernel_cache
from vto_pipeline.numerics.threads import load_tbb

use_kernel_cache()
load_tbb()
