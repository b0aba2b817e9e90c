"""Stages that serve several roles: one row, written once, bound to garment, mannequin and body."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

from vto_pipeline.errors import ComputationError
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.stage import Stage

ROLES = ("garment", "mannequin", "body")
"""What can be scanned."""

RoleFunction = Callable[[Mapping[str, Any], Any, Job], Mapping[str, Any]]


def for_each_role(
    name: str,
    about: str,
    *,
    needs: tuple[str, ...],
    makes: tuple[str, ...],
    run: RoleFunction,
    settings: type[Config],
    uses: tuple[str, ...],
    skip: Callable[[Mapping[str, Any]], str | None] | None = None,
    passes: Mapping[str, str] | None = None,
    fits_memory: bool = False,
) -> tuple[Stage, ...]:
    """One stage per role; the function sees artifact names without the role."""

    def bind(role: str) -> Stage:
        prefix = f"{role}_"

        def bare(inputs: Mapping[str, Any]) -> dict[str, Any]:
            return {key.removeprefix(prefix): value for key, value in inputs.items()}

        @wraps(run)
        def bound(inputs: Mapping[str, Any], settings: Any, job: Job) -> dict[str, Any]:
            try:
                made = run(bare(inputs), settings, job)
            except ComputationError as error:
                error.partial = {prefix + key: value for key, value in error.partial.items()}
                raise
            return {prefix + key: value for key, value in made.items()}

        return Stage(
            name=f"{role}.{name}",
            about=about,
            needs=tuple(prefix + need for need in needs),
            makes=tuple(prefix + made for made in makes),
            run=bound,
            settings=settings,
            uses=uses,
            skip=None if skip is None else lambda inputs: skip(bare(inputs)),
            passes={prefix + made: prefix + need for made, need in (passes or {}).items()},
            fits_memory=fits_memory,
        )

    return tuple(bind(role) for role in ROLES)
