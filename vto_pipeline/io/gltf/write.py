"""Write and read our own GLB files: parts with normals, colours, textures and materials."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.files import check_file, replacing
from vto_pipeline.io.gltf.document import GltfDocument, open_gltf
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.numerics.srgb import decode_srgb, encode_srgb

_LIMIT_BYTES = 500_000_000
_FLOAT, _UNSIGNED = 5126, 5125
_VERTICES, _INDICES = 34962, 34963  # bufferView targets
_SMALL_PICTURE = 512 * 512  # up to here a texture is kept exactly, as PNG; beyond, JPEG keeps the file fit for the web


def write_glb(path: Path, parts: Sequence[GlbPart]) -> None:
    """Write parts as one GLB: single precision, metres, +Y up, one node, mesh and material per part.

    Args:
        path: The file.
        parts: At least one, with names of their own.

    Raises:
        InputError: no part, or two of one name.
    """
    import pygltflib as g

    names = [part.name for part in parts]
    if not parts or len(set(names)) != len(names):
        raise InputError(f"a GLB needs parts of different names; got {names}", where=str(path))
    scene = g.GLTF2(
        asset=g.Asset(version="2.0", generator="vto-pipeline"),
        scene=0,
        scenes=[g.Scene(nodes=list(range(len(parts))))],
    )
    blob = bytearray()

    def view(data: bytes, target: int | None) -> int:
        blob.extend(b"\0" * (-len(blob) % 4))
        scene.bufferViews.append(g.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(data), target=target))
        blob.extend(data)
        return len(scene.bufferViews) - 1

    def accessor(values: np.ndarray, bounds: bool = False) -> int:
        indices = values.dtype.kind == "u"
        scene.accessors.append(
            g.Accessor(
                bufferView=view(values.tobytes(), _INDICES if indices else _VERTICES),
                componentType=_UNSIGNED if indices else _FLOAT,
                count=len(values),
                type="SCALAR" if values.ndim == 1 else f"VEC{values.shape[1]}",
                min=values.min(axis=0).tolist() if bounds else None,
                max=values.max(axis=0).tolist() if bounds else None,
            )
        )
        return len(scene.accessors) - 1

    for index, part in enumerate(parts):
        attributes = g.Attributes(POSITION=accessor(part.mesh.vertices.astype("<f4"), bounds=True))
        if part.normals is not None:
            attributes.NORMAL = accessor(_unit(part.normals))
        if part.uv is not None:
            attributes.TEXCOORD_0 = accessor(part.uv.astype("<f4"))
        if part.mesh.colors is not None:
            attributes.COLOR_0 = accessor(decode_srgb(part.mesh.colors).astype("<f4"))
        surface = g.PbrMetallicRoughness(
            baseColorFactor=list(part.base_color), metallicFactor=part.metallic, roughnessFactor=part.roughness
        )
        if part.texture is not None:
            data, kind = _encode_picture(part.texture)
            scene.images.append(g.Image(bufferView=view(data, None), mimeType=kind, name=part.name))
            scene.textures.append(g.Texture(source=len(scene.images) - 1, sampler=0))
            surface.baseColorTexture = g.TextureInfo(index=len(scene.textures) - 1)
        material = g.Material(pbrMetallicRoughness=surface, doubleSided=part.double_sided, name=part.name)
        if part.base_color[3] < 1:
            material.alphaMode = "BLEND"
        faces = accessor(part.mesh.faces.astype("<u4").ravel())
        primitive = g.Primitive(attributes=attributes, indices=faces, material=index, mode=4)
        scene.materials.append(material)
        scene.meshes.append(g.Mesh(primitives=[primitive], name=part.name))
        scene.nodes.append(g.Node(mesh=index, name=part.name))
    if scene.textures:
        scene.samplers.append(g.Sampler(magFilter=9729, minFilter=9987, wrapS=10497, wrapT=10497))
    blob.extend(b"\0" * (-len(blob) % 4))
    scene.buffers.append(g.Buffer(byteLength=len(blob)))
    scene.set_binary_blob(bytes(blob))
    with replacing(path) as beside:
        beside.write_bytes(b"".join(scene.save_to_bytes()))


def read_glb(path: Path) -> tuple[GlbPart, ...]:
    """Read the parts that `write_glb` wrote, in single precision.

    Raises:
        InputError: no such file; FormatError: no GLB of ours.
    """
    path = check_file(Path(path), {".glb"}, _LIMIT_BYTES)
    document = open_gltf(path)
    return tuple(_part(document, node) for node in document.items("nodes"))


def _unit(normals: FloatArray) -> np.ndarray:
    """Unit in single precision too; a vertex without a direction points up."""
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(lengths > 1e-12, normals / np.maximum(lengths, 1e-12), (0.0, 1.0, 0.0)).astype("<f4")


def _encode_picture(pixels: ByteArray) -> tuple[bytes, str]:
    """PNG when small, else JPEG, and the media type."""
    from PIL import Image

    stream = io.BytesIO()
    if pixels.shape[0] * pixels.shape[1] <= _SMALL_PICTURE:
        Image.fromarray(pixels).save(stream, "PNG")
        return stream.getvalue(), "image/png"
    Image.fromarray(pixels).save(stream, "JPEG", quality=92, subsampling=0)
    return stream.getvalue(), "image/jpeg"


def _part(document: GltfDocument, node: Any) -> GlbPart:
    from PIL import Image

    try:
        (primitive,) = document.item("meshes", node["mesh"])["primitives"]
        attributes = primitive["attributes"]
        material = document.item("materials", primitive["material"])
        surface = material["pbrMetallicRoughness"]

        def values(name: str) -> FloatArray | None:
            return document.accessor(attributes[name]).astype(np.float64) if name in attributes else None

        texture = None
        if "baseColorTexture" in surface:
            source = document.item("textures", surface["baseColorTexture"]["index"])["source"]
            data, _ = document.view(document.item("images", source)["bufferView"])
            texture = np.array(Image.open(io.BytesIO(data), formats=("PNG", "JPEG")).convert("RGB"))
        colors = values("COLOR_0")
        return GlbPart(
            name=str(node["name"]),
            mesh=TriangleMesh(
                document.accessor(attributes["POSITION"]),
                document.accessor(primitive["indices"]).reshape(-1, 3),
                None if colors is None else encode_srgb(colors),
            ),
            normals=values("NORMAL"),
            uv=values("TEXCOORD_0"),
            texture=texture,
            base_color=tuple(surface.get("baseColorFactor", (1.0,) * 4)),
            roughness=surface.get("roughnessFactor", 1.0),
            metallic=surface.get("metallicFactor", 1.0),
            double_sided=material.get("doubleSided", False),
        )
    except (KeyError, TypeError, ValueError) as e:
        raise FormatError(f"not a GLB of parts with materials: {e!r}", where=str(document.path)) from None
