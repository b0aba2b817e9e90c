"""Meshes that a glTF file holds compressed (KHR_draco_mesh_compression), unpacked as if they had never been."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.files import as_format_error
from vto_pipeline.io.gltf.document import COMPONENTS, GltfDocument

NAME = "KHR_draco_mesh_compression"


def unpack_draco(document: GltfDocument) -> GltfDocument:
    """Return a document in which each compressed mesh has a buffer and accessors of its own.

    Raises:
        FormatError: bytes that Draco cannot decode, or that hold no such mesh or attribute.
    """
    unpacked = document
    for mesh in document.items("meshes"):
        for primitive in mesh.get("primitives", []):
            packed = primitive.get("extensions", {}).get(NAME)
            if packed is not None:
                unpacked = _unpack(unpacked, primitive, packed)
    return unpacked


def _unpack(document: GltfDocument, primitive: Mapping[str, Any], packed: Mapping[str, Any]) -> GltfDocument:
    """Decode one primitive; its accessors then lead to what was decoded."""
    import DracoPy

    where = str(document.path)
    data, _ = document.view(packed.get("bufferView"))
    with as_format_error(document.path):
        mesh = DracoPy.decode(data)
    if not isinstance(mesh, DracoPy.DracoMesh):
        raise FormatError("Draco data that hold points and no triangles", where=where)
    values: dict[Any, NDArray[Any]] = {primitive.get("indices"): mesh.faces}
    for name, key in packed.get("attributes", {}).items():
        found = mesh.get_attribute_by_unique_id(key) if isinstance(key, int) else None
        if found is None:
            raise FormatError(f"Draco data without the attribute {key!r}, needed for {name}", where=where)
        values[primitive.get("attributes", {}).get(name)] = found["data"]
    accessors, views = list(document.items("accessors")), list(document.items("bufferViews"))
    buffers, descriptions = list(document.buffers), list(document.items("buffers"))
    for index, array in values.items():
        accessor = document.item("accessors", index)
        kind = COMPONENTS.get(accessor.get("componentType", 0), "<f4")  # another is refused where it is read
        buffers.append(np.ascontiguousarray(array, dtype=kind).tobytes())
        accessors[index] = {**accessor, "bufferView": len(views), "byteOffset": 0}
        views.append({"buffer": len(descriptions), "byteLength": len(buffers[-1])})
        descriptions.append({"byteLength": len(buffers[-1])})
    json = {**document.json, "accessors": accessors, "bufferViews": views, "buffers": descriptions}
    return replace(document, json=json, buffers=tuple(buffers))
