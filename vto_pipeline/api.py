"""The pipeline from Python: what `vto scan`, `fit`, `drape` and `run` do, and what they found."""

from vto_pipeline.stages.entry.commands import drape, fit, run, scan
from vto_pipeline.stages.entry.outcome import Outcome, open_run

__all__ = ["Outcome", "drape", "fit", "open_run", "run", "scan"]
