"""From a document to a checked request: every key known, every setting in range, every file there."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.documents import Document, check_schema, suggest
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.given import Given, find_given
from vto_pipeline.pipeline.schema import VERSION, document_model


@dataclass(frozen=True)
class Request:
    """What a user asks of the engine.

    Args:
        given: Artifact -> what was given for it.
        want: Artifacts, in the order asked for.
        settings: Section -> settings, for every section.
        choose: Artifact -> the stage that is to make it.
        seed: For everything random.
        places: Artifact or "given" -> file and line, for messages.
    """

    given: Mapping[str, Given]
    want: tuple[str, ...]
    settings: Mapping[str, Config]
    choose: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0
    places: Mapping[str, str] = field(default_factory=dict)


def read_request(document: Document, base: Path, catalogue: Catalogue, overrides: Sequence[str] = ()) -> Request:
    """Check a whole document.

    Args:
        document: As loaded.
        base: Folder that relative paths start from: the document's own.
        catalogue: The tables.
        overrides: "section.key=value", which win over the document.

    Raises:
        ConfigError: unknown key, value out of range; with file, line, and suggestion.
        InputError: a file that is given does not exist.
    """
    data = _check_version(document)
    model = document_model(catalogue)
    checked = check_schema(replace(document, data=data), model)
    for text in overrides:
        data = with_setting(data, *read_setting(text, catalogue))
        checked = check_schema(replace(document, data=data), model)
    made = [artifact for stage in catalogue.stages for artifact in stage.makes]
    places = {"given": document.where(("given",))}
    for index, artifact in enumerate(checked.want):
        places[artifact] = document.where(("want", index))
        if artifact not in made:
            raise ConfigError(
                f"want: unknown artifact {artifact!r}", where=places[artifact], hint=suggest(artifact, made)
            )
    for artifact, stage in checked.choose.items():
        _check_choice(artifact, stage, catalogue, document.where(("choose", artifact)))
    return Request(
        given=find_given(data["given"], document, base, catalogue),
        want=tuple(dict.fromkeys(checked.want)),
        settings={section: getattr(checked.stages, section) for section in catalogue.sections},
        choose=checked.choose,
        seed=checked.seed,
        places=places,
    )


def _check_version(document: Document) -> dict[str, Any]:
    """The document's data without `schema`."""
    if not isinstance(document.data, Mapping):
        raise ConfigError("a pipeline document is a mapping with schema, given and want", where=document.where())
    if "run" in document.data and "want" not in document.data:
        raise ConfigError("a document of a batch, not of one run", where=document.where(), hint="`vto batch` takes it")
    data = dict(document.data)
    version = data.pop("schema", None)
    if version != VERSION:
        seen = "is missing" if version is None else f"is {version!r}"
        raise ConfigError(f"schema {seen}; expected {VERSION}", where=document.where(("schema",)))
    return data


def read_setting(text: str, catalogue: Catalogue) -> tuple[str, str, Any]:
    """Return section, key and value of "section.key=value".

    Raises:
        ConfigError: it is written otherwise, there is no such setting, or the value is not valid for it.
    """
    match = re.fullmatch(r"(\w+)\.(\w+)=(.*)", text, re.DOTALL)
    if match is None:
        raise ConfigError(f"--set takes stage.key=value (got {text!r})", hint="as in --set drape.target_error_mm=0.5")
    section, key, value = match[1], match[2], number_or_word(match[3])
    source = Document({}, Path(f"--set {text}"))
    if section not in catalogue.sections:
        raise ConfigError(
            f"stages.{section}: unknown stage", where=source.where(), hint=suggest(section, catalogue.sections)
        )
    alone = with_setting({"given": {}, "want": ["-"]}, section, key, value)
    check_schema(replace(source, data=alone), document_model(catalogue))
    return section, key, value


def with_setting(data: Mapping[str, Any], section: str, key: str, value: Any) -> dict[str, Any]:
    """Return a document's data with one setting changed."""
    stages = dict(data.get("stages") or {})
    stages[section] = {**stages.get(section, {}), key: value}
    return {**data, "stages": stages}


def number_or_word(text: str) -> Any:
    """Parse a value as JSON, else keep it as a string; the settings class validates it."""
    try:
        return json.loads(text)
    except ValueError:
        return text


def _check_choice(artifact: str, stage: str, catalogue: Catalogue, where: str) -> None:
    """Refuse a choice of, or between, things that do not exist."""
    made = {name for row in catalogue.stages for name in row.makes}
    if artifact not in made:
        raise ConfigError(f"choose.{artifact}: unknown artifact", where=where, hint=suggest(artifact, made))
    makers = [maker.name for maker in catalogue.makers(artifact)]
    if stage not in makers:
        raise ConfigError(
            f"choose.{artifact}: {stage!r} does not make it", where=where, hint=f"one of {', '.join(makers)}"
        )
