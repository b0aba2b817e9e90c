"""Open glTF and GLB files: chunks, buffers and accessors, checked against the bytes available before use."""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.formats.polygons import CUT_OFF

_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Number of a component type -> type."""

_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_READ = (
    "KHR_materials_",
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "EXT_texture_webp",
    "KHR_texture_basisu",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
)
"""Extensions that a file may require: they change no shape, need no more than accessors, or are unpacked."""


@dataclass(frozen=True)
class GltfDocument:
    """The JSON of a glTF file and its buffers.

    Args:
        path: The file.
        json: Parsed scene description.
        buffers: Bytes of each buffer, exactly as long as promised.
    """

    path: Path
    json: Mapping[str, Any]
    buffers: tuple[bytes, ...]

    def items(self, name: str) -> list[Mapping[str, Any]]:
        """A top-level array such as "nodes"; empty when absent."""
        values = self.json.get(name, [])
        if not isinstance(values, list) or not all(isinstance(v, dict) for v in values):
            raise FormatError(f"{name} is not a list of objects", where=str(self.path))
        return values

    def item(self, name: str, index: Any) -> Mapping[str, Any]:
        """One entry of a top-level array.

        Raises:
            FormatError: there is no such entry.
        """
        values = self.items(name)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(values):
            raise FormatError(f"{name}[{index}] does not exist; there are {len(values)}", where=str(self.path))
        return values[index]

    def view(self, index: Any) -> tuple[bytes, int]:
        """Bytes of a bufferView and its stride, 0 when packed.

        Raises:
            FormatError: it reaches beyond its buffer.
        """
        view = self.item("bufferViews", index)
        where = f"bufferViews[{index}]"
        self.item("buffers", view.get("buffer"))
        data = self.buffers[view["buffer"]]
        offset, length = self._count(view, "byteOffset", where), self._count(view, "byteLength", where)
        if offset + length > len(data):
            problem = f"{where} ends at byte {offset + length} of a buffer of {len(data)}"
            raise FormatError(problem, where=str(self.path), hint=CUT_OFF)
        return data[offset : offset + length], self._count(view, "byteStride", where)

    def accessor(self, index: Any) -> NDArray[Any]:
        """Values of an accessor, normalized integers as floats.

        Returns:
            Shape (count, width).

        Raises:
            FormatError: it has no bufferView, is sparse, or reaches beyond its bufferView.
        """
        accessor = self.item("accessors", index)
        where = f"accessors[{index}]"
        kind, width = COMPONENTS.get(accessor.get("componentType", 0)), _WIDTHS.get(accessor.get("type", ""))
        count, offset = self._count(accessor, "count", where), self._count(accessor, "byteOffset", where)
        if kind is None or width is None or count == 0:
            raise FormatError(
                f"{where}: component type, type or count is wrong: {dict(accessor)}", where=str(self.path)
            )
        if "bufferView" not in accessor or "sparse" in accessor:
            what = "is sparse" if "sparse" in accessor else f"claims {count} values without a bufferView"
            hint = "write the file with plain buffers: no meshopt, no sparse accessors"
            raise FormatError(f"{where} {what}", where=str(self.path), hint=hint)
        data, stride = self.view(accessor["bufferView"])
        dtype = np.dtype(kind)
        stride = stride or width * dtype.itemsize
        end = offset + (count - 1) * stride + width * dtype.itemsize
        if end > len(data):
            problem = f"{where}: {count} values end at byte {end} of a bufferView of {len(data)}"
            raise FormatError(problem, where=str(self.path), hint=CUT_OFF)
        values = np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))
        if accessor.get("normalized") and dtype.kind in "iu":
            return np.maximum(values / np.iinfo(dtype).max, -1.0)
        return values

    def _count(self, item: Mapping[str, Any], key: str, where: str) -> int:
        """A whole number of at least 0; 0 when absent."""
        value = item.get(key, 0)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise FormatError(f"{where}.{key} is {value!r}; expected a whole number of 0 or more", where=str(self.path))
        return value


def open_gltf(path: Path) -> GltfDocument:
    """Open a .gltf or .glb file and load its buffers.

    Raises:
        FormatError: broken chunks, broken JSON, a buffer outside the file's folder, or fewer bytes than promised.
    """
    data = path.read_bytes()
    text, binary = _chunks(data, path) if data.startswith(b"glTF") else (data, None)
    try:
        parsed = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as e:
        raise FormatError(f"not glTF: {e}", where=str(path)) from None
    asset = parsed.get("asset") if isinstance(parsed, dict) else None
    if not isinstance(asset, dict) or not str(asset.get("version", "")).startswith("2"):
        raise FormatError("not glTF 2.0: asset.version is missing or different", where=str(path))
    required = parsed.get("extensionsRequired", [])
    if not isinstance(required, list):
        raise FormatError("extensionsRequired is not a list", where=str(path))
    for name in required:
        if not str(name).startswith(_READ):
            hint = "export without it, or compressed by Draco"
            raise FormatError(f"the extension {name} is not supported", where=str(path), hint=hint)
    document = GltfDocument(path, parsed, ())
    for image in document.items("images"):
        if "uri" in image:
            contained(str(image["uri"]), path)
    buffers = tuple(_buffer(b, i, binary, path) for i, b in enumerate(document.items("buffers")))
    return GltfDocument(path, parsed, buffers)


def _chunks(data: bytes, path: Path) -> tuple[bytes, bytes | None]:
    """JSON and binary chunk of a GLB."""
    version, length = (int.from_bytes(data[i : i + 4], "little") for i in (4, 8))
    if version != 2 or length != len(data):
        problem = f"GLB version {version}, {length} bytes promised, {len(data)} there; expected version 2"
        raise FormatError(problem, where=str(path), hint=CUT_OFF)
    chunks: dict[int, bytes] = {}
    offset = 12
    while offset < length:
        size, kind = (int.from_bytes(data[i : i + 4], "little") for i in (offset, offset + 4))
        if offset + 8 + size > length:
            raise FormatError(f"a chunk of {size} bytes ends beyond the file", where=str(path), hint=CUT_OFF)
        chunks.setdefault(kind, data[offset + 8 : offset + 8 + size])
        offset += 8 + size
    if _JSON_CHUNK not in chunks:
        raise FormatError("GLB without a JSON chunk", where=str(path))
    return chunks[_JSON_CHUNK], chunks.get(_BINARY_CHUNK)


def _buffer(buffer: Mapping[str, Any], index: int, binary: bytes | None, path: Path) -> bytes:
    """Bytes of one buffer, cut to its promised length."""
    length, uri = buffer.get("byteLength"), buffer.get("uri")
    if not isinstance(length, int) or length < 1:
        raise FormatError(f"buffers[{index}].byteLength is {length!r}", where=str(path))
    if uri is None:
        data = binary if index == 0 and binary is not None else b""
    elif str(uri).startswith("data:"):
        try:
            data = base64.b64decode(str(uri).partition("base64,")[2], validate=True)
        except (binascii.Error, ValueError) as e:
            raise FormatError(f"buffers[{index}]: {e}", where=str(path)) from None
    else:
        beside = contained(str(uri), path)
        if not beside.is_file() or beside.stat().st_size < length:
            size = beside.stat().st_size if beside.is_file() else "no"
            raise FormatError(f"buffer {uri} has {size} bytes; {length} are promised", where=str(path), hint=CUT_OFF)
        with beside.open("rb") as stream:
            data = stream.read(length)
    if len(data) < length:
        problem = f"buffers[{index}] has {len(data)} bytes; {length} are promised"
        raise FormatError(problem, where=str(path), hint=CUT_OFF)
    return data[:length]


def contained(uri: str, path: Path) -> Path:
    """Return the file that a relative uri names, which must lie in the folder of the glTF or below; of data, the glTF.

    Raises:
        FormatError: it does not.
    """
    if uri.startswith("data:"):
        return path
    folder = path.resolve().parent
    target = (folder / unquote(uri)).resolve()
    if ":" in uri or "\\" in unquote(uri) or not target.is_relative_to(folder):
        hint = "put the files it uses beside it, or export as .glb"
        raise FormatError(f"uri {uri[:80]!r} leads out of the folder of the file", where=str(path), hint=hint)
    return target
