"""Untangling of a bad start: cloth that passes through itself or a body.

untangle: the whole of it
contours, flood: where surfaces cross, and which side has to go back
push, minimise, near, rows: the conditions on a few points
relax, smooth: the move that satisfies them
body: which way is out of a body
"""

from vto_pipeline.cloth.untangle.untangle import Untangled, untangle

__all__ = ["Untangled", "untangle"]
