"""An avatar that moves, and its garment, as a GLB with a skin, morph targets and an animation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.io.files import check_file, replacing
from vto_pipeline.io.gltf.principal_shapes import PrincipalShapes, principal_shapes
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.motion import AvatarMotion, ClothMotion
from vto_pipeline.model.render import SKIN
from vto_pipeline.numerics.kinematics import continuous_signs, matrix_quaternions, vector_matrices
from vto_pipeline.numerics.srgb import decode_srgb

_TYPES = {"f4": 5126, "u4": 5125, "u1": 5121}
_KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_VERTICES, _INDICES = 34962, 34963  # bufferView targets
_LIMIT_BYTES = 2_000_000_000
_CLOTH_ERROR_M = 1e-3
"""How far the garment may be from its frames, for a file of few morph targets."""
_CLOTH = {"baseColorFactor": [0.45, 0.55, 0.7, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9}
_BODY = {
    "baseColorFactor": [*decode_srgb(np.array(SKIN, dtype=np.uint8)).tolist(), 1.0],
    "metallicFactor": 0.0,
    "roughnessFactor": 0.6,
}
_INFLUENCES = 4
"""Joints a vertex may follow: more need a second set of weights, which few viewers read."""


def animated_glb(
    avatar: Avatar,
    normals: FloatArray,
    motion: AvatarMotion,
    cloth: ClothMotion | None = None,
    colors: ByteArray | None = None,
) -> tuple[bytes, float]:
    """Return a GLB of the avatar's skin, skeleton and motion, and a garment's: single precision, metres, +Y up.

    Viewers blend linearly (glTF 2.0, 3.7.3), our bodies by dual quaternions: twisted forearms look thinner there. The
    garment is a mesh with morph targets (3.7.2.2), its principal components; the viewer makes its normals.

    Args:
        avatar: Whose motion it is.
        normals: Of the bind pose, unit, shape (V, 3).
        motion: Of this avatar.
        cloth: A garment, with as many frames.
        colors: Of the avatar's vertices, sRGB, shape (V, 3); None: it has the colour of skin.

    Returns:
        The file, and how far the garment's vertices are from its frames in it, at most [m].
    """
    scene = _Scene()
    scene.add_avatar(avatar, normals, colors)
    times = scene.accessor((np.arange(len(motion.poses)) * motion.frame_time).astype("<f4"), bounds=True)
    turns = continuous_signs(matrix_quaternions(vector_matrices(motion.poses)))
    for j, parent in enumerate(avatar.parents.tolist()):
        scene.animate(j, "rotation", times, turns[:, j])
        if parent < 0:
            scene.animate(j, "translation", times, avatar.joints[j] + motion.translations)
    error = 0.0
    if cloth is not None:
        shapes = principal_shapes(cloth.frames, _CLOTH_ERROR_M)
        scene.animate(scene.add_cloth(shapes, cloth.faces), "weights", times, shapes.weights.ravel())
        error = shapes.error
    return scene.as_bytes(), error


def write_glb_bytes(path: Path, made: bytes) -> None:
    """Write what `animated_glb` gave."""
    with replacing(path) as beside:
        beside.write_bytes(made)


def read_glb_bytes(path: Path) -> bytes:
    """Read what `write_glb_bytes` wrote.

    Raises:
        InputError: no such file.
    """
    return check_file(path, {".glb"}, _LIMIT_BYTES).read_bytes()


class _Scene:
    """A glTF document that grows."""

    def __init__(self) -> None:
        import pygltflib

        self._g = pygltflib
        self._made = pygltflib.GLTF2(
            asset=pygltflib.Asset(version="2.0", generator="vto-pipeline"),
            scene=0,
            scenes=[pygltflib.Scene(nodes=[])],
            animations=[pygltflib.Animation(name="motion")],
        )
        self._blob = bytearray()

    def accessor(self, values: np.ndarray, target: int | None = None, bounds: bool = False) -> int:
        """Add an array of numbers, shape (N,) or (N, width), and return its index."""
        g, made = self._g, self._made
        width = 1 if values.ndim == 1 else values.shape[1]
        made.bufferViews.append(
            g.BufferView(buffer=0, byteOffset=len(self._blob), byteLength=values.nbytes, target=target)
        )
        self._blob.extend(values.tobytes())
        self._blob.extend(b"\0" * (-len(self._blob) % 4))
        made.accessors.append(
            g.Accessor(
                bufferView=len(made.bufferViews) - 1,
                componentType=_TYPES[values.dtype.str[1:]],
                count=len(values),
                type=_KINDS[width],
                min=np.atleast_1d(values.min(axis=0)).tolist() if bounds else None,
                max=np.atleast_1d(values.max(axis=0)).tolist() if bounds else None,
            )
        )
        return len(made.accessors) - 1

    def add_avatar(self, avatar: Avatar, normals: FloatArray, colors: ByteArray | None) -> None:
        """Add the joints as the first nodes, then the skin."""
        g, made, joints = self._g, self._made, len(avatar.joint_names)
        strongest = np.argsort(-avatar.weights, axis=1, kind="stable")[:, :_INFLUENCES]
        shares = np.take_along_axis(avatar.weights, strongest, axis=1)
        shares = shares / shares.sum(axis=1, keepdims=True)
        strongest = np.where(shares > 0, strongest, 0)  # a joint of no weight must be the first
        attributes = g.Attributes(
            POSITION=self.accessor(avatar.bind_vertices.astype("<f4"), _VERTICES, bounds=True),
            NORMAL=self.accessor(normals.astype("<f4"), _VERTICES),
            JOINTS_0=self.accessor(strongest.astype("u1"), _VERTICES),
            WEIGHTS_0=self.accessor(shares.astype("<f4"), _VERTICES),
        )
        faces = self.accessor(avatar.faces.astype("<u4").ravel(), _INDICES)
        surface = dict(_BODY)
        if colors is not None:
            attributes.COLOR_0 = self.accessor(decode_srgb(colors).astype("<f4"), _VERTICES)
            surface["baseColorFactor"] = [1.0, 1.0, 1.0, 1.0]
        made.materials.append(g.Material(pbrMetallicRoughness=g.PbrMetallicRoughness(**surface)))
        primitive = g.Primitive(attributes=attributes, indices=faces, mode=4, material=len(made.materials) - 1)
        made.meshes.append(g.Mesh(primitives=[primitive], name="avatar"))
        inverse = np.tile(np.eye(4), (joints, 1, 1))
        inverse[:, 3, :3] = -avatar.joints  # stored by columns
        for j, parent in enumerate(avatar.parents.tolist()):
            place = avatar.joints[j] - (avatar.joints[parent] if parent >= 0 else 0.0)
            children = np.flatnonzero(avatar.parents == j).tolist()
            made.nodes.append(g.Node(name=avatar.joint_names[j], translation=place.tolist(), children=children))
        made.nodes.append(g.Node(name="avatar", mesh=0, skin=0))
        matrices = self.accessor(inverse.reshape(joints, 16).astype("<f4"))
        made.skins.append(g.Skin(joints=list(range(joints)), inverseBindMatrices=matrices))
        made.scenes[0].nodes += [*np.flatnonzero(avatar.parents < 0).tolist(), joints]

    def add_cloth(self, shapes: PrincipalShapes, faces: IntArray) -> int:
        """Add a mesh with morph targets, seen from both sides, and return its node."""
        g, made = self._g, self._made
        made.materials.append(g.Material(doubleSided=True, pbrMetallicRoughness=g.PbrMetallicRoughness(**_CLOTH)))
        primitive = g.Primitive(
            attributes=g.Attributes(POSITION=self.accessor(shapes.base.astype("<f4"), _VERTICES, bounds=True)),
            indices=self.accessor(faces.astype("<u4").ravel(), _INDICES),
            mode=4,
            material=len(made.materials) - 1,
            targets=[
                {"POSITION": self.accessor(shape.astype("<f4"), _VERTICES, bounds=True)} for shape in shapes.shapes
            ],
        )
        made.meshes.append(g.Mesh(primitives=[primitive], name="garment", weights=shapes.weights[0].tolist()))
        made.nodes.append(g.Node(name="garment", mesh=len(made.meshes) - 1))
        made.scenes[0].nodes.append(len(made.nodes) - 1)
        return len(made.nodes) - 1

    def animate(self, node: int, kind: str, times: int, values: np.ndarray) -> None:
        """Let a node's rotation, translation or weights follow values at times, an accessor; straight between."""
        g, animation = self._g, self._made.animations[0]
        if len(values) == 0:
            return  # cloth that never moves
        output = self.accessor(values.astype("<f4"))
        animation.samplers.append(g.AnimationSampler(input=times, output=output, interpolation="LINEAR"))
        target = g.AnimationChannelTarget(node=node, path=kind)
        animation.channels.append(g.AnimationChannel(sampler=len(animation.samplers) - 1, target=target))

    def as_bytes(self) -> bytes:
        """Return the GLB."""
        self._made.buffers.append(self._g.Buffer(byteLength=len(self._blob)))
        self._made.set_binary_blob(bytes(self._blob))
        return b"".join(self._made.save_to_bytes())
