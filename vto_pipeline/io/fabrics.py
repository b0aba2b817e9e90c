"""Fabrics: the presets, and files of measured values in textile units, converted to SI on reading.

Which kind of file it is shows in its content: `instrument` heads a sheet of KES-FB or FAST, `schema` with `material` or
`raw_data` a U3M file, and all else is a fabric file of this package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import yaml

from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.io.documents import Document, load_yaml, suggest
from vto_pipeline.io.fabric_formats.assumed import Figures, complete_fabric
from vto_pipeline.io.fabric_formats.document import read_document
from vto_pipeline.io.fabric_formats.fast import read_fast
from vto_pipeline.io.fabric_formats.kes import read_kes
from vto_pipeline.io.fabric_formats.sheets import load_csv
from vto_pipeline.io.fabric_formats.u3m import is_u3m, load_u3m, read_u3m
from vto_pipeline.io.files import replacing
from vto_pipeline.model.fabric import Fabric

_PRESETS = Path(__file__).parent / "fabric_presets"

_INSTRUMENTS: dict[str, Callable[[Document], Figures]] = {"KES-FB": read_kes, "FAST": read_fast}


def _load_json(path: Path) -> Document:
    """Load a U3M file, or a fabric file with the line numbers of its keys."""
    document = load_u3m(path)
    return document if is_u3m(document.data) else load_yaml(path)


_LOADERS: dict[str, Callable[[Path], Document]] = {
    ".yaml": load_yaml,
    ".yml": load_yaml,
    ".json": _load_json,
    ".csv": load_csv,
    ".u3m": load_u3m,
}


def read_fabric(fabric: str | Path | Mapping[str, Any]) -> Fabric:
    """Read a preset by name, a fabric file, an instrument's sheet, a U3M material, or a fabric file's keys.

    Args:
        fabric: Name of a preset, path of a file, or a mapping.

    Returns:
        The fabric in SI; `assumed` names what was not measured.

    Raises:
        ConfigError: no such preset, or a fabric file with an unknown key (with its line) or a value out of range.
        InputError: no such file, or a sheet or material that does not hold what it should.
    """
    if isinstance(fabric, Mapping):
        return complete_fabric(_read(Document(dict(fabric), Path("the document"))))
    path = Path(fabric)
    suffix = path.suffix.lower()
    if suffix == ".u3ma":
        raise InputError("archives are not supported", where=str(path), hint="unpack it and give the .u3m file inside")
    if suffix not in _LOADERS:
        names = preset_names()
        if str(fabric) not in names:
            problem = f"{str(fabric)!r} is neither a preset nor a file of type {', '.join(_LOADERS)}"
            raise ConfigError(problem, where="fabric", hint=suggest(str(fabric), names))
        return _read_preset(str(fabric))
    return complete_fabric(_read(_LOADERS[suffix](path)))


def write_measured(
    path: Path, areal_density_gsm: float, directions: Sequence[str], rigidity: float, source: str
) -> None:
    """Write a fabric file that holds a mass and a bending rigidity, and nothing that was not measured.

    Args:
        path: File, .yaml.
        areal_density_gsm: [g/m²].
        directions: warp, weft or both.
        rigidity: In these directions [N·m].
        source: Where the figures come from.

    Raises:
        ConfigError: the name does not end in .yaml.
    """
    path = Path(path)
    if path.suffix.lower() not in (".yaml", ".yml"):
        raise ConfigError(
            f"files of type {path.suffix or '(none)'} cannot hold a fabric; expected .yaml", where=str(path)
        )
    held = {
        "name": path.stem,
        "areal_density_gsm": areal_density_gsm,
        "bending": {direction: float(f"{rigidity:.4g}") for direction in directions},
        "source": source,
    }
    with replacing(path) as beside:
        beside.write_text(yaml.safe_dump(held, sort_keys=False, allow_unicode=True), encoding="utf-8")


@lru_cache(maxsize=64)  # the rows of a batch name the same few
def _read_preset(name: str) -> Fabric:
    return complete_fabric(_read(load_yaml(_PRESETS / f"{name}.yaml")))


@cache
def preset_names() -> tuple[str, ...]:
    """Names of the presets, sorted."""
    return tuple(sorted(path.stem for path in _PRESETS.glob("*.yaml")))


def _read(document: Document) -> Figures:
    data = document.data
    if is_u3m(data):
        return read_u3m(document)
    if not isinstance(data, Mapping) or "instrument" not in data:
        return read_document(document)
    instrument = str(data["instrument"])
    if instrument not in _INSTRUMENTS:
        where, hint = document.where(("instrument",)), suggest(instrument, _INSTRUMENTS)
        raise InputError(f"instrument: {instrument!r} is not supported", where=where, hint=hint)
    return _INSTRUMENTS[instrument](document)
