"""Several garments in one document: the tables with each garment's own rows, and one drape for all.

`given.garments` maps names to garments, inner first. Whatever is one garment's has its name in front then, artifacts,
files and stages alike: `shirt_draped`, `shirt_draped.ply`, `shirt.simulation_mesh`. `want: [draped]` means all of them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

from vto_pipeline.assess.allowance import known_kinds
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.outfit.layers import drape_layers
from vto_pipeline.errors import ConfigError, FormatError
from vto_pipeline.io.documents import Document
from vto_pipeline.io.fabric_formats.assumed import assumption_notes
from vto_pipeline.model.artifact import ArtifactKind
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.outfit import Layer
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.schema import json_schema
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.stages.cloth import in_body_frame
from vto_pipeline.stages.outfit_page import OWN_PARTS, outfit_page

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]

_OWN_ROWS = ("sew", "take_mesh", "simulation_mesh", "rest_shape", "grade", "transfer", "assess")
_OWN = (
    "garment_mesh",
    "garment_pattern",
    "panels",
    "garment",
    "openings",
    "observed",
    "sim_mesh",
    "rest_shape",
    "fabric",
    "worn_rest",
    "draped",
    *OWN_PARTS,
)
"""Artifacts of which each garment has its own."""

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_KEYS = ("mesh", "pattern", "fabric")
"""Keys under a garment's name in a document; with the garment's name in front, artifacts."""


def garment_names(document: Document) -> tuple[str, ...]:
    """Return the names of the garments of a document that gives several, inner first; none where it gives one.

    Raises:
        ConfigError: they are no mapping of names to garments, a name will not do, or one garment is given as well.
    """
    given = document.data.get("given") if isinstance(document.data, Mapping) else None
    if not isinstance(given, Mapping) or "garments" not in given:
        return ()
    garments, where = given["garments"], document.where(("given", "garments"))
    if "motion" in given:
        raise ConfigError(
            "given.motion: only one garment can follow a motion",
            where=document.where(("given", "motion")),
            hint="give garment instead of garments",
        )
    if "garment" in given:
        raise ConfigError("given.garment and given.garments: give one or the other", where=where)
    if not isinstance(garments, Mapping) or not garments:
        hint = "as in garments: {trousers: {mesh: trousers.ply}, shirt: {mesh: shirt.ply}}, inner first"
        raise ConfigError(f"given.garments: expected named garments (got {garments!r})", where=where, hint=hint)
    for name in garments:
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise ConfigError(
                f"given.garments: {name!r} is not a valid garment name",
                where=document.where(("given", "garments", str(name))),
                hint="use lower-case letters, digits and _, with a letter first",
            )
    return tuple(garments)


def names_in_run(record: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of the garments of a run, inner first, from what run.json holds; none where it had one."""
    try:
        rows = [str(stage["name"]).rpartition(".") for stage in record["stages"]]
    except (KeyError, TypeError):
        raise FormatError("run.json holds no stages by name", hint="run the document again") from None
    return tuple(name for name, _, row in rows if name and row == "take_mesh")


def expand_document(document: Document, names: Sequence[str]) -> Document:
    """Return the document with the fabric that garments share given for each, and what is wanted of each named."""
    if not names:
        return document
    given = dict(document.data["given"])
    fabric = given.pop("fabric", None)
    shared = {} if fabric is None else {"fabric": fabric}
    given["garments"] = {
        name: {**shared, **one} if isinstance(one, Mapping) else one for name, one in given["garments"].items()
    }
    data, lines = {**document.data, "given": given}, dict(document.lines)
    if isinstance(data.get("want"), list):
        named = [
            (f"{name}_{artifact}" if artifact in _OWN else artifact, index)
            for index, artifact in enumerate(data["want"])
            for name in (names if artifact in _OWN else names[:1])
        ]
        data["want"] = [artifact for artifact, _ in named]
        for at, (_, index) in enumerate(named):
            line = document.line_of(("want", index))
            if line is not None:
                lines["want", at] = line
    return Document(data, document.path, lines)


def outfit_tables(tables: Catalogue, names: Sequence[str]) -> Catalogue:
    """Return the tables for these garments, inner first; the same where there are none.

    Raises:
        ConfigError: a name makes two artifacts share theirs.
    """
    return _outfit_tables(tables, tuple(names)) if names else tables


@lru_cache(maxsize=32)
def _outfit_tables(tables: Catalogue, names: tuple[str, ...]) -> Catalogue:
    kinds = {kind.name: kind for kind in tables.kinds}
    own = [_kind(kinds[artifact], name) for name in names for artifact in _OWN]
    rest = [kind for kind in tables.kinds if kind.name not in _OWN]
    taken = [kind.name for kind in (*own, *rest)]
    twins = sorted({artifact for artifact in taken if taken.count(artifact) > 1})
    if twins:
        raise ConfigError(f"given.garments: {twins[0]} would be ambiguous", hint="rename a garment")
    rows: list[Stage] = []
    for stage in tables.stages:
        if stage.name in _OWN_ROWS:
            rows += [_row(stage, name) for name in names]
        elif stage.name == "drape":
            rows.append(_drape_row(stage, names))
        elif stage.name == "page":
            rows.append(outfit_page(stage, names))
        elif not any(artifact in _OWN or artifact.startswith("garment_") for artifact in (*stage.needs, *stage.makes)):
            rows.append(stage)
    given = {key: artifact for key, artifact in tables.given.items() if not key.startswith("garment.")}
    del given["fabric"]
    for name in names:
        given |= {f"garments.{name}.{key}": f"{name}_{key}" for key in _KEYS}
    return Catalogue(tuple(rows), (*own, *rest), given)


def document_schema(tables: Catalogue) -> dict[str, Any]:
    """Return the JSON schema of a document, for one garment or, if these tables know garments, several."""
    schema = json_schema(tables)
    if "garment.mesh" not in tables.given:
        return schema
    several = json_schema(outfit_tables(tables, ("name",)))
    schema["$defs"]["Garment"] = several["$defs"]["Given_garments_name"] | {"title": "Garment"}
    schema["$defs"]["Given"]["properties"]["garments"] = {
        "type": "object",
        "minProperties": 1,
        "propertyNames": {"pattern": f"^{_NAME.pattern}$"},
        "additionalProperties": {"$ref": "#/$defs/Garment"},
        "description": "Instead of garment: several garments by name, worn in layers, innermost first.",
    }
    return schema


def _own(artifact: str, name: str) -> str:
    """Return what an artifact of one garment is called where there are several."""
    return f"{name}_{artifact.removeprefix('garment_')}" if artifact in _OWN else artifact


def _kind(kind: ArtifactKind, name: str) -> ArtifactKind:
    return replace(
        kind,
        name=_own(kind.name, name),
        filename=f"{name}_{kind.filename}" if kind.filename else "",
        about=f"{name}: {kind.about}",
        previews=tuple((f"{name}_{file}", write) for file, write in kind.previews),
    )


def _row(stage: Stage, name: str) -> Stage:
    """Return the row of one garment; its function sees artifact names without the garment's."""
    bare = {_own(artifact, name): artifact for artifact in (*stage.needs, *stage.optional)}

    def bound(inputs: Inputs, settings: Any, job: Job) -> Outputs:
        if stage.name == "assess" and name in known_kinds():
            settings = settings.model_copy(update={"garment": name})
        made = stage.run({bare[artifact]: value for artifact, value in inputs.items()}, settings, job)
        return {_own(artifact, name): value for artifact, value in made.items()}

    return replace(
        stage,
        name=f"{name}.{stage.name}",
        needs=tuple(_own(artifact, name) for artifact in stage.needs),
        optional=tuple(_own(artifact, name) for artifact in stage.optional),
        makes=tuple(_own(artifact, name) for artifact in stage.makes),
        run=bound,
        idle=lambda settings: tuple(_own(artifact, name) for artifact in stage.idle(settings)),
    )


def _drape_row(stage: Stage, names: Sequence[str]) -> Stage:
    """Return the row that drapes all garments."""
    needs = tuple(_own(artifact, name) for name in names for artifact in ("sim_mesh", "worn_rest", "fabric"))

    def run(inputs: Inputs, settings: DrapeConfig, job: Job) -> Outputs:
        layers = []
        for name in names:
            fabric = inputs[_own("fabric", name)]
            job.notes += [f"{name}: {text}" for text in assumption_notes(fabric)]
            pattern = inputs.get(_own("garment_pattern", name))
            mesh = in_body_frame(inputs[_own("sim_mesh", name)], inputs)
            worn = pattern is not None and pattern.worn
            garment = Garment(mesh, inputs[_own("worn_rest", name)], pattern is not None, worn)
            layers.append(Layer(name, garment, fabric))
        outfit = drape_layers(layers, inputs["collider"], settings, job)
        meshes = {_own("draped", name): mesh for name, mesh in outfit.meshes.items()}
        return {**meshes, "audit": dict(outfit.audit), "trace": tuple(outfit.trace)}

    return replace(
        stage,
        about="the garments at rest on the body, in layers",
        needs=(*needs, "collider"),
        optional=(*(_own("garment_pattern", name) for name in names), "source_turn"),
        makes=(*(_own("draped", name) for name in names), "audit", "trace"),
        run=run,
    )
