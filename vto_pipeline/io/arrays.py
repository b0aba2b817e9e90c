"""NumPy archives (.npz) without pickles; equal arrays give equal bytes."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.files import check_file, replacing

Arrays = dict[str, NDArray[Any]]

_LIMIT_BYTES = 4_000_000_000
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the oldest date a zip can hold; a real one would change the bytes


BROKEN_ZIP = (
    *(zipfile.BadZipFile, zlib.error, ValueError, EOFError, KeyError, OSError),
    RuntimeError,  # encrypted
)
"""What `zipfile` raises on damaged bytes."""

_ENDING = ".npy"
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def write_arrays(path: Path, arrays: Mapping[str, Any], *, compress: bool = False) -> None:
    """Write named arrays to an .npz file, in the order of their names.

    Args:
        path: The file.
        arrays: Name -> array, number or string; no objects.
        compress: Deflate; slower, for arrays with much repetition such as depth maps.
    """
    kind = zipfile.ZIP_DEFLATED if compress else zipfile.ZIP_STORED
    with replacing(path) as beside, zipfile.ZipFile(beside, "w", kind, compresslevel=1) as archive:
        for name in sorted(arrays):
            entry = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            entry.compress_type = kind
            with archive.open(entry, "w", force_zip64=True) as stream:
                npy.write_array(stream, np.asarray(arrays[name], order="C"), version=(1, 0), allow_pickle=False)


def read_arrays(path: Path, required: Collection[str] = (), only: Collection[str] | None = None) -> Arrays:
    """Read the arrays of an .npz file.

    Args:
        path: The file.
        required: Names that must be there.
        only: Names to read where they are there; the others are not looked at. None: all.

    Raises:
        InputError: missing or too large; FormatError: not an archive of plain arrays, or a name is missing.
    """
    path = check_file(Path(path), {".npz"}, _LIMIT_BYTES)
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
        promised = sum(entry.file_size for entry in members)
        if promised > _LIMIT_BYTES:
            raise FormatError(f"unpacks to {promised} bytes; the limit is {_LIMIT_BYTES}", where=str(path))
        if not {entry.compress_type for entry in members} <= {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
            raise FormatError("packed by another method than deflate", where=str(path))
        with zipfile.ZipFile(path) as archive:
            entries = {entry.filename[: -len(_ENDING)]: entry for entry in members if entry.filename.endswith(_ENDING)}
            arrays = {name: _array(archive, e) for name, e in entries.items() if only is None or name in only}
    except (*BROKEN_ZIP, SyntaxError, TokenError) as e:
        raise FormatError(f"not an archive of plain arrays: {e}", where=str(path)) from None
    missing = sorted(set(required) - set(arrays))
    if missing:
        raise FormatError(f"arrays missing: {', '.join(missing)}; found {', '.join(sorted(arrays))}", where=str(path))
    return arrays


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> NDArray[Any]:
    """Read one array, after what its header promises was held against its size.

    Raises:
        ValueError: no plain array of the size that is promised; SyntaxError, TokenError: in its header.
    """
    with archive.open(entry) as stream:
        version = npy.read_magic(stream)
        if version not in _HEADERS:
            raise ValueError(f"{entry.filename} has version {version}")
        shape, _, dtype = _HEADERS[version](stream)
        promised = stream.tell() + math.prod(shape) * dtype.itemsize
        if promised != entry.file_size and not dtype.hasobject:  # fewer would end before the checksum is compared
            raise ValueError(f"{entry.filename} promises shape {shape} and has {entry.file_size} bytes")
    with archive.open(entry) as stream:
        array: NDArray[Any] = npy.read_array(stream, allow_pickle=False)
    return array
