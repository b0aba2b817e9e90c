"""YAML and JSON documents: read safely, with the line of every key; written in one canonical form."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel, ValidationError

from vto_pipeline.errors import ConfigError, FormatError, VtoError
from vto_pipeline.io.files import check_file, replacing

Keys = tuple[str | int, ...]

_YAML_BYTES = 1_000_000
_JSON_BYTES = 200_000_000
_ALIASES = 16  # an alias bomb needs dozens
_DEPTH = 32


class _Loader(yaml.SafeLoader):
    """Safe YAML in which 1e-5 is a number, as YAML 1.2 has it and YAML 1.1 does not."""


_FLOAT = re.compile(
    r"""[-+]?(?:(?:[0-9][0-9_]*)\.[0-9_]*(?:[eE][-+]?[0-9]+)?|[0-9][0-9_]*[eE][-+]?[0-9]+
        |\.[0-9][0-9_]*(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$""",
    re.X,
)
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+0123456789."))


@dataclass(frozen=True)
class Document:
    """A YAML document with the lines of its keys.

    Args:
        data: Plain dicts, lists and scalars.
        path: The file.
        lines: Path of keys -> line, counted from 1.
    """

    data: Any
    path: Path
    lines: Mapping[Keys, int] = field(default_factory=dict)

    def line_of(self, keys: Sequence[str | int]) -> int | None:
        """The line of a key, such as ("stages", "sfm", "max_keypoint"); None when the document has no such key."""
        return self.lines.get(tuple(keys))

    def where(self, keys: Sequence[str | int] = ()) -> str:
        """File and line for an error message; the nearest enclosing key's line when the key itself is absent."""
        for end in range(len(keys), 0, -1):
            line = self.line_of(keys[:end])
            if line is not None:
                return f"{self.path}, line {line}"
        return str(self.path)


def load_yaml(path: Path, *, error: type[VtoError] = ConfigError) -> Document:
    """Read a YAML file with the safe loader; size, nesting and aliases are limited, duplicate keys refused.

    Args:
        path: The file, .yaml, .yml or .json (JSON is YAML).
        error: What to raise: ConfigError for documents, InputError for input files.

    Raises:
        VtoError: of the class `error`, with the line.
    """
    path = check_file(Path(path), {".yaml", ".yml", ".json"}, _YAML_BYTES, error=error)
    try:
        text = path.read_text(encoding="utf-8")
        _check_events(text, path, error)
        loader = _Loader(text)
        root = loader.get_single_node()
        lines: dict[Keys, int] = {}
        if root is not None:
            _collect_lines(root, (), lines, path, error)
        data = loader.construct_document(root) if root is not None else None
    except UnicodeDecodeError as e:
        raise error(f"not UTF-8 text (byte {e.start})", where=str(path)) from None
    except yaml.MarkedYAMLError as e:
        mark = e.problem_mark
        where = f"{path}, line {mark.line + 1}" if mark is not None else str(path)
        raise error(f"not valid YAML: {e.problem}", where=where, hint="check indentation and colons") from None
    except (yaml.YAMLError, ValueError, TypeError) as e:  # odd characters, impossible dates, unhashable keys
        raise error(f"not valid YAML: {e}", where=str(path)) from None
    return Document(data, path, lines)


def check_schema(document: Document, schema: type[BaseModel], *, error: type[VtoError] = ConfigError) -> Any:
    """Return the document's data as an instance of the schema.

    Raises:
        VtoError: of the class `error`: the first fault, with the value seen, what is allowed, the line, and a
            suggestion for a misspelt key.
    """
    data = document.data if document.data is not None else {}
    try:
        return schema.model_validate(data)
    except ValidationError as e:
        fault = e.errors(include_url=False, include_context=False)[0]
    keys = tuple(fault["loc"])
    name = ".".join(str(k) for k in keys) or "document"
    if fault["type"] == "extra_forbidden":
        holder = _schema_at(schema, keys[:-1])
        allowed = list(holder.model_fields) if holder else []
        problem = f"{name}: unknown key (got {fault['input']!r})"
        raise error(problem, where=document.where(keys), hint=suggest(str(keys[-1]), allowed))
    seen = "" if fault["type"] == "missing" else f" (got {fault['input']!r})"
    raise error(f"{name}: {fault['msg'][:1].lower()}{fault['msg'][1:]}{seen}", where=document.where(keys))


def suggest(name: str, allowed: Collection[str]) -> str:
    """A hint for a misspelt name: the nearest allowed one, else the list."""
    close = get_close_matches(name, list(allowed), n=1, cutoff=0.6)
    return f"did you mean {close[0]}?" if close else f"allowed: {', '.join(sorted(allowed))}"


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        InputError: missing, or FormatError: not JSON.
    """
    path = check_file(Path(path), {".json"}, _JSON_BYTES)
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as e:
        raise FormatError(f"not valid JSON: {e}", where=str(path)) from None


def write_json(path: Path, value: Any) -> None:
    """Write JSON with sorted keys; arrays become lists, tuples lists, and a float its shortest exact form."""
    text = json.dumps(value, sort_keys=True, indent=1, default=_plain, ensure_ascii=False, allow_nan=False)
    with replacing(path) as beside:
        beside.write_text(text + "\n", encoding="utf-8")


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} has no JSON form")


def _check_events(text: str, path: Path, error: type[VtoError]) -> None:
    """Refuse alias bombs and deep nesting before any tree is built."""
    depth = aliases = 0
    for event in yaml.parse(text, Loader=_Loader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        aliases += isinstance(event, yaml.AliasEvent)
        if depth > _DEPTH or aliases > _ALIASES:
            what = f"nested deeper than {_DEPTH}" if depth > _DEPTH else f"more than {_ALIASES} aliases"
            line = event.start_mark.line + 1 if event.start_mark else 1
            raise error(f"YAML with {what} is refused", where=f"{path}, line {line}")


def _collect_lines(node: yaml.Node, keys: Keys, lines: dict[Keys, int], path: Path, error: type[VtoError]) -> None:
    """Fill `lines` for a node and all below it."""
    if len(keys) > _DEPTH:
        raise error("YAML that contains itself is refused", where=str(path))
    if isinstance(node, yaml.SequenceNode):
        for index, child in enumerate(node.value):
            lines[(*keys, index)] = child.start_mark.line + 1
            _collect_lines(child, (*keys, index), lines, path, error)
    elif isinstance(node, yaml.MappingNode):
        for key, child in node.value:
            here, line = (*keys, str(key.value)), key.start_mark.line + 1
            if here in lines:
                name = ".".join(str(k) for k in here)
                raise error(f"{name}: given twice (also in line {lines[here]})", where=f"{path}, line {line}")
            lines[here] = line
            _collect_lines(child, here, lines, path, error)


def _schema_at(schema: type[BaseModel], keys: Keys) -> type[BaseModel] | None:
    """The schema of a nested section."""
    for key in keys:
        inner = schema.model_fields[str(key)].annotation if str(key) in schema.model_fields else None
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return None
        schema = inner
    return schema
