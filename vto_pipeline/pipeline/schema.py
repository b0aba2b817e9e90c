"""The shape of a pipeline document, derived from the tables: nothing about it is written down twice."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, create_model

from vto_pipeline.pipeline.catalogue import Catalogue

VERSION = 1
"""Of the document; the only one there is."""

_STRICT = ConfigDict(extra="forbid", frozen=True)


def document_model(catalogue: Catalogue) -> type[BaseModel]:
    """A pydantic model of all sections of a document but `schema`."""
    sections = {name: (kind, kind()) for name, kind in catalogue.sections.items()}
    stages: Any = create_model("Stages", __config__=_STRICT, **sections)  # type: ignore[call-overload]
    given: Any = _given_model(catalogue)
    return create_model(
        "Document",
        __config__=_STRICT,
        given=(given, Field(description="What there is: paths relative to the document's own folder.")),
        want=(list[str], Field(min_length=1, description="Artifacts to make.")),
        stages=(stages, Field(default=stages(), description="Settings that differ from the defaults.")),
        choose=(dict[str, str], Field(default={}, description="Artifact -> stage, where several could make it.")),
        seed=(int, Field(default=0, ge=0, lt=2**32, description="For everything random.")),
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
    """One field per section of `given`: a sub-model where keys have two parts, else the value itself."""
    groups: dict[str, dict[str, Any]] = {}
    fields: dict[str, Any] = {}
    for key, artifact in catalogue.given.items():
        section, _, leaf = key.partition(".")
        kind = catalogue.kind(artifact)
        value = str if kind.inline is None else str | dict[str, Any]
        field = (value, Field(default=None, description=kind.about))
        if leaf:
            groups.setdefault(section, {})[leaf] = field
        else:
            fields[section] = field
    for section, members in groups.items():
        model = create_model(f"Given_{section}", __config__=_STRICT, **members)
        fields[section] = (model, Field(default=model()))
    return create_model("Given", __config__=_STRICT, **fields)
