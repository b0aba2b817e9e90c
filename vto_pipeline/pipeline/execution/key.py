"""The keys of a result, of a whole run and of a measured time: everything that decides them, and nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from importlib import metadata
from typing import Any

from vto_pipeline.errors import MissingDependencyError
from vto_pipeline.pipeline.execution.cost import machine, thread_count
from vto_pipeline.pipeline.execution.digest import OfPath, code_identity, digest_given, digest_path, digest_value
from vto_pipeline.pipeline.plan import Plan, Step
from vto_pipeline.pipeline.request import Request


def result_key(
    step: Step, inputs: Mapping[str, str], seed: int, force_all: bool, time_budget: float | None = None
) -> str:
    """Digest of stage, settings with defaults, content of the inputs, versions, seed.

    Args:
        step: The stage and its settings.
        inputs: Artifact -> content digest, for the inputs it gets.
        seed: The run's.
        force_all: Whether nothing may be left out.
        time_budget: Of the whole run [s], for a stage that does by it what it can in time.
    """
    budget = {} if time_budget is None else {"time_budget_s": time_budget}
    return digest_value({**_of_step(step), "inputs": dict(inputs), **_of_run(seed, force_all), **budget})[:32]


def run_key(request: Request, plan: Plan, force_all: bool, of_path: OfPath = digest_path) -> str:
    """Digest of all that the keys of a run's results are made of, and of what it shows besides.

    It is known before anything is run, as it has what was given in the place of what stages make of it.

    Args:
        request: What is given; its files are read for their digests.
        plan: All stages, final ones among them.
        force_all: Whether nothing may be left out.
        of_path: Digest of a file or folder.
    """
    parts = {
        "steps": [{**_of_step(step), "inputs": step.inputs} for step in plan.steps],
        "makers": plan.makers,
        "given": {artifact: digest_given(one, of_path) for artifact, one in request.given.items()},
        "want": request.want,
        **_of_run(request.seed, force_all),
    }
    return digest_value(parts)[:32]


def time_key() -> str:
    """Digest of what a measured time holds for: this code, this machine, this many threads."""
    return digest_value({"code": code_identity(), "machine": machine(), "threads": thread_count()})[:32]


def _of_step(step: Step) -> dict[str, Any]:
    return {"stage": step.stage.name, "settings": step.settings.model_dump_json(), "uses": versions(step.stage.uses)}


def _of_run(seed: int, force_all: bool) -> dict[str, Any]:
    return {"code": code_identity(), "seed": seed, "force_all": force_all}


def versions(distributions: Iterable[str]) -> dict[str, str]:
    """Installed versions.

    Raises:
        MissingDependencyError: one is not installed.
    """
    return {name: _version(name) for name in distributions}


@cache
def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        raise MissingDependencyError(
            f"{name} is not installed", hint=f"pip install {name}; `vto doctor` shows all"
        ) from None
