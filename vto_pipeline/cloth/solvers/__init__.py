"""Ways to move a cloth on in time: each takes a model, and advances a state in front of contacts."""

from __future__ import annotations

from vto_pipeline.cloth.solvers.xpbd import Xpbd

SOLVERS = {"xpbd": Xpbd}
