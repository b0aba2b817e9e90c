"""The key of a result: everything that decides its bytes, and nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import metadata

from vto_pipeline.errors import MissingDependencyError
from vto_pipeline.pipeline.execution.digest import code_identity, digest_value
from vto_pipeline.pipeline.plan import Step


def result_key(step: Step, inputs: Mapping[str, str], seed: int, force_all: bool) -> str:
    """Digest of stage, settings with defaults, content of the inputs, versions, seed.

    Args:
        step: The stage and its settings.
        inputs: Artifact -> content digest, for the inputs it gets.
        seed: The run's.
        force_all: Whether nothing may be left out.
    """
    parts = {
        "stage": step.stage.name,
        "settings": step.settings.model_dump(mode="json"),
        "inputs": dict(inputs),
        "uses": versions(step.stage.uses),
        "code": code_identity(),
        "seed": seed,
        "force_all": force_all,
    }
    return digest_value(parts)[:32]


def versions(distributions: Iterable[str]) -> dict[str, str]:
    """Installed versions.

    Raises:
        MissingDependencyError: one is not installed.
    """
    found = {}
    for name in distributions:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            raise MissingDependencyError(
                f"{name} is not installed", hint=f"pip install {name}; `vto doctor` shows all"
            ) from None
    return found
