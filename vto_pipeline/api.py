"""The pipeline from Python: what `vto scan`, `fit`, `drape` and `run` do, and what they found."""

from vto_pipeline.model.body import Avatar
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.notebook import CARDS
from vto_pipeline.stages.entry.cards import avatar_card, garment_card, mesh_card, outcome_card
from vto_pipeline.stages.entry.commands import drape, fit, run, scan
from vto_pipeline.stages.entry.outcome import Outcome, open_run

__all__ = ["Outcome", "drape", "fit", "open_run", "run", "scan"]

CARDS[TriangleMesh] = mesh_card
CARDS[Garment] = garment_card
CARDS[Avatar] = avatar_card
CARDS[Outcome] = outcome_card
