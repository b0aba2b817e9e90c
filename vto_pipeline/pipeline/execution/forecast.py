"""What a run would do: which results are stored, and how long and large the others will be, by earlier runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from vto_pipeline.pipeline.execution.cost_model import CostModel, step_figures
from vto_pipeline.pipeline.execution.digest import OfPath, digest_given, digest_path
from vto_pipeline.pipeline.execution.key import result_key
from vto_pipeline.pipeline.execution.store import Result, Store
from vto_pipeline.pipeline.plan import Plan, Step
from vto_pipeline.pipeline.request import Request


@dataclass(frozen=True)
class Expected:
    """What is known of a stage before it runs.

    Args:
        stored: Whether its result is there already.
        seconds, peak_mb: Of its stored result, or as the cost model forecasts them; None where the stage never ran.
    """

    stored: bool
    seconds: float | None
    peak_mb: float | None


def forecast(request: Request, plan: Plan, store: Store, force_all: bool = False) -> dict[str, Expected]:
    """Return stage -> what is known of it, for each stage of a plan.

    Args:
        request: What is given; its files are read for their digests.
        plan: What would be done.
        store: Where earlier results are.
        force_all: Of the run.
    """
    found = {}
    model, figures = CostModel(store), step_figures(request, plan)
    for step, result in stored_results(request, plan, store, force_all):
        name = step.stage.name
        if result is not None:
            found[name] = Expected(True, result.record["seconds"], result.record["peak_mb"])
        else:
            found[name] = Expected(False, model.seconds(name, figures[name]), model.peak_mb(name, figures[name]))
    return found


def stored_results(
    request: Request, plan: Plan, store: Store, force_all: bool = False, of_path: OfPath = digest_path
) -> Iterator[tuple[Step, Result | None]]:
    """Yield each stage of a plan with its result if that is stored; what depends on one that is not is not known.

    Args:
        request, plan, store, force_all: As for `forecast`.
        of_path: Digest of a file or folder.
    """
    digests = {artifact: digest_given(one, of_path) for artifact, one in request.given.items()}
    for step in plan.steps:
        stage = step.stage
        result = None
        if not stage.final and all(artifact in digests for artifact in step.inputs):
            inputs = {artifact: digests[artifact] for artifact in step.inputs}
            result = store.find(stage.name, result_key(step, inputs, request.seed, force_all))
        if result is not None:
            mine = [a for a in stage.makes if plan.makers.get(a) == stage.name]
            digests |= {artifact: result.digest(artifact) for artifact in mine}
        yield step, result
