"""glTF skins: joints, weights and bind matrices of a skeleton at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.gltf.document import GltfDocument
from vto_pipeline.model.arrays import FloatArray

_SETS = 8  # JOINTS_0 to JOINTS_7
_JOINTS = 1000


@dataclass(frozen=True)
class Skin:
    """One skin, at rest.

    Args:
        names: J names.
        joints: World positions, shape (J, 3).
        parents: -1 for a root, shape (J,).
        matrices: From the vertices' space to the world, shape (J, 4, 4).
    """

    names: tuple[str, ...]
    joints: FloatArray
    parents: NDArray[np.int64]
    matrices: FloatArray

    def place(self, points: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the skinned points in the world (glTF 2.0, 3.7.3), shape (V, 3)."""
        blended = np.tensordot(weights, self.matrices, 1)
        return np.einsum("vij,vj->vi", blended[:, :3, :3], points) + blended[:, :3, 3]


def read_skin(document: GltfDocument, index: Any, worlds: Mapping[int, FloatArray]) -> Skin:
    """Read a skin.

    Args:
        document: The file.
        index: Of the skin.
        worlds: Node -> world transform, shape (4, 4), of every node of the scene.

    Raises:
        FormatError: a joint is not a node of the scene, or its matrices are not as many as its joints.
    """
    where = str(document.path)
    skin = document.item("skins", index)
    nodes = skin.get("joints")
    if not isinstance(nodes, list) or not 0 < len(nodes) <= _JOINTS or any(node not in worlds for node in nodes):
        raise FormatError(f"skins[{index}]: its joints must be 1 to {_JOINTS} nodes of the scene", where=where)
    worlds_at = np.array([worlds[node] for node in nodes])
    inverse = np.tile(np.eye(4), (len(nodes), 1, 1))
    if "inverseBindMatrices" in skin:
        inverse = document.accessor(skin["inverseBindMatrices"]).astype(np.float64)
        if inverse.shape != (len(nodes), 16):
            raise FormatError(f"skins[{index}]: {len(inverse)} matrices for {len(nodes)} joints", where=where)
        inverse = inverse.reshape(-1, 4, 4).swapaxes(1, 2)  # stored by columns
    if not np.isfinite(inverse).all():
        raise FormatError(f"skins[{index}]: a matrix is not finite", where=where)
    above = {child: k for k, node in enumerate(document.items("nodes")) for child in node.get("children", [])}
    place = {node: k for k, node in enumerate(nodes)}

    def parent(node: int) -> int:
        for _ in range(len(worlds)):
            node = above.get(node, -1)
            if node in place:
                return place[node]
        return -1

    return Skin(
        tuple(str(document.item("nodes", node).get("name", f"joint_{k}")) for k, node in enumerate(nodes)),
        worlds_at[:, :3, 3],
        np.array([parent(node) for node in nodes], dtype=np.int64),
        worlds_at @ inverse,
    )


def read_weights(document: GltfDocument, attributes: Mapping[str, Any], count: int, joints: int) -> FloatArray:
    """Read a primitive's weights.

    Args:
        document: The file.
        attributes: Of the primitive.
        count: Its vertices.
        joints: Of its skin.

    Returns:
        Rows that sum to 1, shape (count, joints).

    Raises:
        FormatError: weights that do not fit the vertices, a joint the skin lacks, or a vertex that nothing holds.
    """
    where = str(document.path)
    weights = np.zeros((count, joints))
    for k in range(_SETS):
        if f"JOINTS_{k}" not in attributes or f"WEIGHTS_{k}" not in attributes:
            break
        joint = document.accessor(attributes[f"JOINTS_{k}"])
        share = document.accessor(attributes[f"WEIGHTS_{k}"]).astype(np.float64)
        if joint.shape != (count, 4) or share.shape != (count, 4) or joint.dtype.kind != "u":
            raise FormatError(f"JOINTS_{k} and WEIGHTS_{k} are not four per vertex for {count} vertices", where=where)
        if joint.max() >= joints:
            raise FormatError(f"JOINTS_{k} names joint {joint.max()}; the skin has {joints}", where=where)
        if not np.isfinite(share).all() or (share < 0).any():
            raise FormatError(f"WEIGHTS_{k} holds a value that is negative or not finite", where=where)
        np.add.at(weights, (np.repeat(np.arange(count), 4), joint.ravel().astype(np.int64)), share.ravel())
    total = weights.sum(axis=1, keepdims=True)
    if (total <= 0).any():
        raise FormatError(f"{int((total <= 0).sum())} vertices of a skinned part have no weights", where=where)
    normed: FloatArray = weights / total
    return normed
