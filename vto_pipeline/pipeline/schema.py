"""The schema of a pipeline document, derived from the tables."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, create_model

from vto_pipeline.pipeline.catalogue import Catalogue

VERSION = 1
"""Of the document; the only one there is."""

_STRICT = ConfigDict(extra="forbid", frozen=True)


@lru_cache(maxsize=32)
def document_model(catalogue: Catalogue) -> type[BaseModel]:
    """A pydantic model of all sections of a document but `schema`."""
    sections = {name: (kind, kind()) for name, kind in catalogue.sections.items()}
    stages: Any = create_model("Stages", __config__=_STRICT, **sections)  # type: ignore[call-overload]
    given: Any = _given_model(catalogue)
    return create_model(
        "Document",
        __config__=_STRICT,
        given=(given, Field(description="Inputs; paths are relative to the document's own folder")),
        want=(list[str], Field(min_length=1, description="Artifacts to make")),
        stages=(stages, Field(default=stages(), description="Settings that differ from the defaults")),
        choose=(dict[str, str], Field(default={}, description="Artifact -> stage that makes it, where several could")),
        seed=(int, Field(default=0, ge=0, lt=2**32, description="Seed of all random numbers")),
    )


def json_schema(catalogue: Catalogue) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a document, for editors."""
    schema = document_model(catalogue).model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "vto pipeline document"
    schema["properties"] = {"schema": {"const": VERSION, "description": "Version of the format."}} | schema[
        "properties"
    ]
    schema["required"] = ["schema", *schema["required"]]
    made = sorted({artifact for stage in catalogue.stages for artifact in stage.makes})
    schema["properties"]["want"]["items"] = {"enum": made}
    return schema


def _given_model(catalogue: Catalogue) -> type[BaseModel]:
    """A model of `given`: one of its own for each part of a key but the last, which is the value itself."""
    tree: dict[str, Any] = {}
    for key, artifact in catalogue.given.items():
        kind, branch = catalogue.kind(artifact), tree
        *sections, leaf = key.split(".")
        for section in sections:
            branch = branch.setdefault(section, {})
        value = str if kind.inline is None else str | dict[str, Any]
        branch[leaf] = (value, Field(default=None, description=kind.about))
    return _branch_model("Given", tree)


def _branch_model(name: str, branch: dict[str, Any]) -> type[BaseModel]:
    fields = {}
    for key, inner in branch.items():
        if isinstance(inner, dict):
            model: Any = _branch_model(f"{name}_{key}", inner)
            inner = (model, Field(default=model()))
        fields[key] = inner
    made: type[BaseModel] = create_model(name, __config__=_STRICT, **fields)
    return made
