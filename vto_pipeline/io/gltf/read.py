"""The triangles of a glTF scene, in world coordinates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.gltf.document import GltfDocument, open_gltf
from vto_pipeline.io.gltf.draco import unpack_draco
from vto_pipeline.io.gltf.pictures import base_factor, scene_picture
from vto_pipeline.io.gltf.skin import Skin, read_skin, read_weights
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.srgb import decode_srgb, encode_srgb

_TRIANGLES = 4
_NODES = 10_000  # visits: a node may be reached by many parents in a broken file


def parse_gltf(name: str) -> Arrays:
    """Read the triangles of the default scene; morph targets, animations, other maps than base colour are ignored.

    A skinned part stands as its skeleton at rest holds it.

    Args:
        name: Path of a .gltf or .glb file.

    Returns:
        vertices (V, 3), placed by their nodes; faces (F, 3); colors (V, 3) uint8, where any part has some or a base
        colour other than white; texture (F, 3, 2), where every part has it; if there is any, picture (H, W, 3) uint8
        and the places there (F, 3, 2), where those without texture coordinates are of one colour; notes.
        Where every part hangs on one skin also joint_names, joints (J, 3), parents (J,), weights (V, J).

    Raises:
        FormatError: the file breaks the format, or has no triangles.
    """
    document = unpack_draco(open_gltf(Path(name)))
    vertices, faces, notes = [], [], []
    colors: list[np.ndarray | None] = []
    textures: list[np.ndarray | None] = []
    parts = []
    count = 0
    worlds = dict(_placed_nodes(document))
    skins: dict[int, Skin] = {}
    weights: list[np.ndarray] = []
    for index, transform in worlds.items():
        node = document.item("nodes", index)
        if "mesh" not in node:
            continue
        skin = skins.setdefault(node["skin"], read_skin(document, node["skin"], worlds)) if "skin" in node else None
        for primitive in document.item("meshes", node["mesh"]).get("primitives", []):
            if primitive.get("mode", _TRIANGLES) != _TRIANGLES:
                notes.append("ignored a part that is not a list of triangles")
                continue
            points, triangles, color, texture = _primitive(document, primitive)
            if skin is None:
                if np.linalg.det(transform[:3, :3]) < 0:  # a mirror turns the triangles inside out
                    triangles = triangles[:, ::-1]
                points = points @ transform[:3, :3].T + transform[:3, 3]
            else:  # the node's own transform does not count
                shares = read_weights(document, primitive.get("attributes", {}), len(points), len(skin.joints))
                points = skin.place(points, shares)
                weights.append(shares)
            vertices.append(points)
            faces.append(triangles + count)
            colors.append(color)
            textures.append(None if texture is None else texture[triangles])
            parts.append(primitive)
            count += len(points)
    if not faces:
        raise FormatError("the scene has no triangles", where=name)
    if len(faces) > 1:
        notes.append(f"joined {len(faces)} parts into one mesh")
    arrays: Arrays = {"vertices": np.concatenate(vertices), "faces": np.concatenate(faces)}
    try:
        shades = _shades(document, parts, colors, vertices)
        if shades is not None:
            arrays["colors"] = shades
    except FormatError as e:  # the shape is whole without them
        notes.append(f"colours are ignored: {e.problem}")
    placed = [place for place in textures if place is not None]
    if len(placed) == len(faces):
        arrays["texture"] = np.concatenate(placed)
    if placed and all(
        place is not None or "COLOR_0" not in part["attributes"] for place, part in zip(textures, parts, strict=True)
    ):
        every = [
            np.full((len(f), 3, 2), 0.5) if place is None else place for place, f in zip(textures, faces, strict=True)
        ]
        try:
            shown = scene_picture(document, parts, every)
            if shown is not None:
                arrays["picture"], arrays["places"] = shown
        except FormatError as e:  # the shape is whole without it
            notes.append(f"pictures are ignored: {e.problem}")
    if len(skins) == 1 and len(weights) == len(faces):
        (skin,) = skins.values()
        arrays |= {
            "joint_names": np.array(skin.names, dtype=np.str_),
            "joints": skin.joints,
            "parents": skin.parents,
            "weights": np.concatenate(weights),
        }
    return {**arrays, "notes": np.array(notes, dtype=np.str_)}


def _shades(
    document: GltfDocument,
    parts: Sequence[Mapping[str, Any]],
    colors: Sequence[np.ndarray | None],
    vertices: Sequence[FloatArray],
) -> np.ndarray | None:
    """Return the colours of all vertices, sRGB, shape (V, 3), times their materials'; None where all is white."""
    factors = [base_factor(document, part) for part in parts]
    if all(color is None for color in colors) and all((factor == 1.0).all() for factor in factors):
        return None
    shades = []
    for color, factor, points in zip(colors, factors, vertices, strict=True):
        own = np.full((len(points), 3), 255, np.uint8) if color is None else color
        shades.append(own if (factor == 1.0).all() else encode_srgb(decode_srgb(own) * factor))
    return np.concatenate(shades)


def _primitive(
    document: GltfDocument, primitive: Mapping[str, Any]
) -> tuple[FloatArray, np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Points (V, 3), triangles (F, 3), and colours (V, 3) and texture coordinates (V, 2) or None, of one primitive."""
    where = str(document.path)
    attributes = primitive.get("attributes", {})
    points = document.accessor(attributes.get("POSITION")).astype(np.float64)
    if points.shape[1] != 3:
        raise FormatError(f"positions have {points.shape[1]} coordinates", where=where)
    if "indices" in primitive:
        indices = document.accessor(primitive["indices"]).astype(np.int64).ravel()
    else:
        indices = np.arange(len(points))
    if len(indices) % 3:
        raise FormatError(f"{len(indices)} indices do not form whole triangles", where=where)
    if indices.min() < 0 or indices.max() >= len(points):  # here, since joined to other parts it would look valid
        raise FormatError(f"face index {indices.max()} is outside 0..{len(points) - 1}", where=where)
    color = None
    if "COLOR_0" in attributes:
        values = document.accessor(attributes["COLOR_0"])[:, :3]
        if values.shape != points.shape:
            raise FormatError(f"{len(values)} colours for {len(points)} vertices", where=where)
        color = encode_srgb(values)  # glTF keeps vertex colours linear
    texture = None
    if "TEXCOORD_0" in attributes:
        values = document.accessor(attributes["TEXCOORD_0"]).astype(np.float64)
        if values.shape == (len(points), 2) and np.isfinite(values).all():
            texture = values * (1.0, -1.0) + (0.0, 1.0)  # glTF counts v downward
    return points, indices.reshape(-1, 3), color, texture


def _placed_nodes(document: GltfDocument) -> Iterator[tuple[int, FloatArray]]:
    """Index and world transform (4, 4) of every node of the default scene."""
    scenes = document.items("scenes")
    if scenes:
        roots = document.item("scenes", document.json.get("scene", 0)).get("nodes", [])
    else:
        roots = list(range(len(document.items("nodes"))))
    stack: list[tuple[Any, FloatArray, tuple[Any, ...]]] = [(root, np.eye(4), ()) for root in reversed(roots)]
    visits = 0
    while stack:
        index, above, path = stack.pop()
        visits += 1
        if index in path or visits > _NODES:
            raise FormatError("the nodes form a loop, or there are too many", where=str(document.path))
        node = document.item("nodes", index)
        world = above @ _local(node, document.path)
        yield index, world
        stack += [(child, world, (*path, index)) for child in reversed(node.get("children", []))]


def _local(node: Mapping[str, Any], path: Path) -> FloatArray:
    """A node's own transform, from its matrix or its translation, rotation (x, y, z, w) and scale."""
    try:
        if "matrix" in node:
            return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64)
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        local = np.eye(4)
        local[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), dtype=np.float64).reshape(3)
        local[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64).reshape(3)
    except (TypeError, ValueError) as e:
        raise FormatError(f"cannot parse a node's transform: {e}", where=str(path)) from None
    return local
