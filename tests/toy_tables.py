"""A catalogue that knows nothing of garments: arithmetic on numbers kept in text files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field

from vto_pipeline.errors import ComputationError, InputError
from vto_pipeline.model.artifact import ArtifactKind
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.stage import Stage

CALLS: list[str] = []
"""Names of the stages that really ran, in order."""

WORDS = {"seven": 7, "eleven": 11}


class AddConfig(Config):
    """Settings of the toy sum."""

    offset: int = Field(0, ge=0, le=100, description="added to the sum")
    fail: bool = Field(False, description="stop with an error")


def read_number(path: Path) -> int:
    """The number in a file."""
    try:
        return int(path.read_text())
    except ValueError:
        raise InputError(f"not a number: {path.read_text()!r}", where=str(path)) from None


def receive_number(path: Path, job: Job) -> int:
    """A number from outside, with a word about it."""
    job.note(f"{path.name}: read as a decimal number")
    return read_number(path)


def write_number(path: Path, value: Any) -> None:
    """Number or word to file."""
    path.write_text(str(value))


def number_of_word(value: Any) -> int:
    """A number written in the document: a word, or {value: 3}, or {file: path}."""
    if isinstance(value, Mapping):
        return read_number(value["file"]) if "file" in value else int(value["value"])
    if value not in WORDS:
        raise InputError(f"unknown word {value!r}", hint=f"one of {', '.join(WORDS)}")
    return WORDS[value]


def _kind(name: str, **more: Any) -> ArtifactKind:
    return ArtifactKind(name, f"{name}.txt", f"the number {name}", read_number, write_number, **more)


def _leaf(name: str, **more: Any) -> ArtifactKind:
    return ArtifactKind(name, "", f"the number {name}", read_number, write_number, **more)


def _double(role: str) -> Any:
    def run(inputs: Mapping[str, Any], _: Config, job: Job) -> Mapping[str, Any]:
        CALLS.append(f"{role}.double")
        job.progress(0.5, "half way")
        job.measure(rms_mm=0.25)
        return {f"{role}_doubled": 2 * inputs[f"{role}_number"]}

    return run


def _add(inputs: Mapping[str, Any], settings: AddConfig, job: Job) -> Mapping[str, Any]:
    CALLS.append("add")
    total = sum(inputs.values()) + settings.offset
    job.warn("toy sum")
    if settings.fail:
        raise ComputationError("sum diverged", hint="use smaller numbers", partial={"total": -1})
    return {"total": total}


def _call(name: str, function: Any) -> Any:
    def run(inputs: Mapping[str, Any], settings: Any, job: Job) -> Mapping[str, Any]:
        CALLS.append(name)
        return function(inputs)

    return run


def _page(inputs: Mapping[str, Any], settings: Any, job: Job) -> Mapping[str, Any]:
    CALLS.append("page")
    statuses = {stage["name"]: stage["status"] for stage in inputs["run_record"]["stages"]}
    values = {name: value for name, value in inputs.items() if name != "run_record"}
    return {"page": json.dumps({"values": values, "statuses": statuses}, sort_keys=True)}


def _zero(inputs: Mapping[str, Any]) -> str | None:
    return "the total is zero" if inputs["total"] == 0 else None


STAGES = (
    Stage("left.double", "twice the left", ("left_number",), ("left_doubled",), _double("left")),
    Stage("right.double", "twice the right", ("right_number",), ("right_doubled",), _double("right")),
    Stage("add", "the sum", ("left_doubled",), ("total",), _add, AddConfig, ("right_doubled",), ("numpy",)),
    Stage("guess", "a sum from a word", ("word",), ("total",), _call("guess", lambda i: {"total": i["word"]})),
    Stage(
        "square",
        "the square",
        ("total",),
        ("squared",),
        _call("square", lambda i: {"squared": i["total"] ** 2}),
        skip=_zero,
        passes={"squared": "total"},
    ),
    Stage("parity", "odd or even", ("total",), ("parity",), _call("parity", lambda i: {"parity": i["total"] // 2 % 2})),
    Stage("label", "what it is", ("parity",), ("label",), _call("label", lambda i: {"label": i["parity"] + 10})),
    Stage("page", "all of it", (), ("page",), _page, optional=("total", "label", "left_number"), final=True),
)

KINDS = (
    _leaf("left_number", receive=receive_number),
    _leaf("right_number"),
    _kind("left_doubled"),
    _kind("right_doubled"),
    _kind("total", previews=(("total.preview", write_number),)),
    _leaf("word", inline=number_of_word),
    _kind("squared"),
    _kind("parity"),
    _kind("label"),
    ArtifactKind("page", "page.json", "a page", Path.read_text, write_number),
)

GIVEN = {"left.number": "left_number", "left.doubled": "left_doubled", "right.number": "right_number", "word": "word"}

TOY = Catalogue(STAGES, KINDS, GIVEN)
