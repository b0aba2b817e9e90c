"""Write and read our own GLB files: parts with normals, colours, textures and materials."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.files import check_file, replacing
from vto_pipeline.io.gltf.document import COMPONENTS, GltfDocument, open_gltf
from vto_pipeline.io.gltf.quantise import quantised_box, quantised_share, quantised_signed
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.numerics.srgb import decode_srgb, encode_srgb

_LIMIT_BYTES = 500_000_000
_COMPONENT = {kind: number for number, kind in COMPONENTS.items()}
_VERTICES, _INDICES = 34962, 34963  # bufferView targets


def write_glb(path: Path, parts: Sequence[GlbPart]) -> None:
    """Write parts as one GLB: single precision, metres, +Y up, one node, mesh and material per part.

    Args:
        path: The file.
        parts: At least one, with names of their own.

    Raises:
        InputError: no part, or two of one name.
    """
    data = glb_bytes(parts, GlbLayout())
    with replacing(path) as beside:
        beside.write_bytes(data)


@dataclass(frozen=True)
class GlbLayout:
    """How a GLB keeps what it holds.

    Args:
        quality: Of JPEG pictures.
        exact_pixels: Pictures of so many pixels at most are kept exactly, as PNG.
        quantised: Whether coordinates take two bytes instead of four (KHR_mesh_quantization).
    """

    quality: int = 92
    exact_pixels: int = 512 * 512
    quantised: bool = False


def glb_bytes(parts: Sequence[GlbPart], layout: GlbLayout) -> bytes:
    """Return parts as the bytes of one GLB; see `write_glb`.

    Raises:
        InputError: no part, or two of one name.
    """
    import pygltflib as g

    names = [part.name for part in parts]
    if not parts or len(set(names)) != len(names):
        raise InputError(f"a GLB needs parts of different names; got {names}")
    extensions = ["KHR_mesh_quantization"] if layout.quantised else []
    scene = g.GLTF2(
        asset=g.Asset(version="2.0", generator="vto-pipeline"),
        scene=0,
        scenes=[g.Scene(nodes=list(range(len(parts))))],
        extensionsUsed=extensions,
        extensionsRequired=extensions,
    )
    blob = bytearray()

    def view(data: bytes, target: int | None, stride: int | None = None) -> int:
        blob.extend(b"\0" * (-len(blob) % 4))
        scene.bufferViews.append(
            g.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(data), byteStride=stride, target=target)
        )
        blob.extend(data)
        return len(scene.bufferViews) - 1

    def attribute(values: np.ndarray, positions: bool = False) -> int:
        """An accessor of one row a vertex; whole numbers stand for shares of their largest, but not as positions."""
        row = values.shape[1] * values.itemsize
        rows = np.zeros((len(values), row + -row % 4), np.uint8)  # each begins at a multiple of four bytes
        rows[:, :row] = np.ascontiguousarray(values).view(np.uint8)
        scene.accessors.append(
            g.Accessor(
                bufferView=view(rows.tobytes(), _VERTICES, rows.shape[1]),
                componentType=_COMPONENT[values.dtype.str],
                normalized=values.dtype.kind != "f" and not positions,
                count=len(values),
                type=f"VEC{values.shape[1]}",
                min=values.min(axis=0).tolist() if positions else None,
                max=values.max(axis=0).tolist() if positions else None,
            )
        )
        return len(scene.accessors) - 1

    def indices(faces: np.ndarray) -> int:
        short = layout.quantised and faces.max() < 65_535  # the largest number has a meaning of its own
        values = faces.astype("<u2" if short else "<u4").ravel()
        kept = view(values.tobytes(), _INDICES)
        scene.accessors.append(
            g.Accessor(bufferView=kept, componentType=_COMPONENT[values.dtype.str], count=len(values), type="SCALAR")
        )
        return len(scene.accessors) - 1

    for index, part in enumerate(parts):
        node = g.Node(mesh=index, name=part.name)
        if layout.quantised:
            points, low, step = quantised_box(part.mesh.vertices)
            node.translation, node.scale = low.tolist(), [step] * 3
        else:
            points = part.mesh.vertices.astype("<f4")
        attributes = g.Attributes(POSITION=attribute(points, positions=True))
        if part.normals is not None:
            normals = _unit(part.normals)
            attributes.NORMAL = attribute(quantised_signed(normals) if layout.quantised else normals)
        if part.uv is not None:
            within = layout.quantised and part.uv.min() >= 0.0 and part.uv.max() <= 1.0
            attributes.TEXCOORD_0 = attribute(quantised_share(part.uv) if within else part.uv.astype("<f4"))
        if part.mesh.colors is not None:
            colors = decode_srgb(part.mesh.colors)
            attributes.COLOR_0 = attribute(quantised_share(colors) if layout.quantised else colors.astype("<f4"))
        surface = g.PbrMetallicRoughness(
            baseColorFactor=list(part.base_color), metallicFactor=part.metallic, roughnessFactor=part.roughness
        )
        if part.texture is not None:
            data, kind = _encode_picture(part.texture, layout)
            scene.images.append(g.Image(bufferView=view(data, None), mimeType=kind, name=part.name))
            scene.textures.append(g.Texture(source=len(scene.images) - 1, sampler=0))
            surface.baseColorTexture = g.TextureInfo(index=len(scene.textures) - 1)
        material = g.Material(pbrMetallicRoughness=surface, doubleSided=part.double_sided, name=part.name)
        if part.base_color[3] < 1:
            material.alphaMode = "BLEND"
        faces = indices(part.mesh.faces)
        primitive = g.Primitive(attributes=attributes, indices=faces, material=index, mode=4)
        scene.materials.append(material)
        scene.meshes.append(g.Mesh(primitives=[primitive], name=part.name))
        scene.nodes.append(node)
    if scene.textures:
        scene.samplers.append(g.Sampler(magFilter=9729, minFilter=9987, wrapS=10497, wrapT=10497))
    blob.extend(b"\0" * (-len(blob) % 4))
    scene.buffers.append(g.Buffer(byteLength=len(blob)))
    scene.set_binary_blob(bytes(blob))
    return b"".join(scene.save_to_bytes())


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


def _encode_picture(pixels: ByteArray, layout: GlbLayout) -> tuple[bytes, str]:
    """PNG when small, else JPEG, and the media type."""
    from PIL import Image

    stream = io.BytesIO()
    if pixels.shape[0] * pixels.shape[1] <= layout.exact_pixels:
        Image.fromarray(pixels).save(stream, "PNG")
        return stream.getvalue(), "image/png"
    Image.fromarray(pixels).save(stream, "JPEG", quality=layout.quality, subsampling=0)
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
