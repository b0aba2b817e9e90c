"""An avatar that moves, as a GLB with a skin and an animation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.io.files import replacing
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.motion import AvatarMotion
from vto_pipeline.numerics.kinematics import continuous_signs, matrix_quaternions, vector_matrices

_TYPES = {"f4": 5126, "u4": 5125, "u1": 5121}
_KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_VERTICES, _INDICES = 34962, 34963  # bufferView targets
_INFLUENCES = 4
"""Joints a vertex may follow: more need a second set of weights, which few viewers read."""


def write_animated_glb(path: Path, avatar: Avatar, normals: FloatArray, motion: AvatarMotion) -> None:
    """Write the avatar's skin, skeleton and motion: single precision, metres, +Y up.

    Viewers blend linearly (glTF 2.0, 3.7.3), our bodies by dual quaternions: twisted forearms look thinner there.

    Args:
        path: The file.
        avatar: Whose motion it is.
        normals: Of the bind pose, unit, shape (V, 3).
        motion: Of this avatar.
    """
    import pygltflib as g

    joints = len(avatar.joint_names)
    scene = g.GLTF2(asset=g.Asset(version="2.0", generator="vto-pipeline"), scene=0)
    blob = bytearray()

    def accessor(values: np.ndarray, target: int | None = None, bounds: bool = False) -> int:
        width = 1 if values.ndim == 1 else values.shape[1]
        scene.bufferViews.append(g.BufferView(buffer=0, byteOffset=len(blob), byteLength=values.nbytes, target=target))
        blob.extend(values.tobytes())
        blob.extend(b"\0" * (-len(blob) % 4))
        scene.accessors.append(
            g.Accessor(
                bufferView=len(scene.bufferViews) - 1,
                componentType=_TYPES[values.dtype.str[1:]],
                count=len(values),
                type=_KINDS[width],
                min=np.atleast_1d(values.min(axis=0)).tolist() if bounds else None,
                max=np.atleast_1d(values.max(axis=0)).tolist() if bounds else None,
            )
        )
        return len(scene.accessors) - 1

    strongest = np.argsort(-avatar.weights, axis=1, kind="stable")[:, :_INFLUENCES]
    shares = np.take_along_axis(avatar.weights, strongest, axis=1)
    shares = shares / shares.sum(axis=1, keepdims=True)
    strongest = np.where(shares > 0, strongest, 0)  # a joint of no weight must be the first
    attributes = g.Attributes(
        POSITION=accessor(avatar.bind_vertices.astype("<f4"), _VERTICES, bounds=True),
        NORMAL=accessor(normals.astype("<f4"), _VERTICES),
        JOINTS_0=accessor(strongest.astype("u1"), _VERTICES),
        WEIGHTS_0=accessor(shares.astype("<f4"), _VERTICES),
    )
    faces = accessor(avatar.faces.astype("<u4").ravel(), _INDICES)
    scene.meshes.append(g.Mesh(primitives=[g.Primitive(attributes=attributes, indices=faces, mode=4)], name="avatar"))
    inverse = np.tile(np.eye(4), (joints, 1, 1))
    inverse[:, 3, :3] = -avatar.joints  # stored by columns
    for j, parent in enumerate(avatar.parents.tolist()):
        place = avatar.joints[j] - (avatar.joints[parent] if parent >= 0 else 0.0)
        children = np.flatnonzero(avatar.parents == j).tolist()
        scene.nodes.append(g.Node(name=avatar.joint_names[j], translation=place.tolist(), children=children))
    roots = np.flatnonzero(avatar.parents < 0).tolist()
    scene.nodes.append(g.Node(name="avatar", mesh=0, skin=0))
    matrices = accessor(inverse.reshape(joints, 16).astype("<f4"))
    scene.skins.append(g.Skin(joints=list(range(joints)), inverseBindMatrices=matrices))
    scene.scenes.append(g.Scene(nodes=[*roots, joints]))
    times = accessor((np.arange(len(motion.poses)) * motion.frame_time).astype("<f4"), bounds=True)
    turns = continuous_signs(matrix_quaternions(vector_matrices(motion.poses)))
    places = {root: avatar.joints[root] + motion.translations for root in roots}
    animation = g.Animation(name="motion")
    for j in range(joints):
        for kind, values in (("rotation", turns[:, j]), ("translation", places.get(j))):
            if values is not None:
                output = accessor(values.astype("<f4"))
                animation.samplers.append(g.AnimationSampler(input=times, output=output, interpolation="LINEAR"))
                target = g.AnimationChannelTarget(node=j, path=kind)
                animation.channels.append(g.AnimationChannel(sampler=len(animation.samplers) - 1, target=target))
    scene.animations.append(animation)
    scene.buffers.append(g.Buffer(byteLength=len(blob)))
    scene.set_binary_blob(bytes(blob))
    with replacing(path) as beside:
        beside.write_bytes(b"".join(scene.save_to_bytes()))
