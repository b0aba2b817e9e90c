"""Kernels that read like the paper: arrays in, arrays out."""

from __future__ import annotations

from vto_pipeline.numerics.threads import load_tbb

load_tbb()
