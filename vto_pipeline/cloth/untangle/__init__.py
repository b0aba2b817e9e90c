"""Untangling of a bad start: of cloth that passes through itself or a body."""

from vto_pipeline.cloth.untangle.untangle import Untangled, untangle

__all__ = ["Untangled", "untangle"]
