"""A garment in motion in a GLB: what a viewer adds up is where the garment was."""

from __future__ import annotations

import numpy as np
import pytest

from vto_pipeline.avatar.template.template import template
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.io.gltf.animate import animated_glb, write_glb_bytes
from vto_pipeline.io.gltf.principal_shapes import principal_shapes
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import AvatarMotion, ClothMotion

FRAMES, VERTICES = 24, 60


def swaying(rank: int, noise: float = 0.0) -> np.ndarray:
    """Frames that are sums of this many shapes, each with a course of its own."""
    rng = np.random.default_rng(3)
    shapes = rng.normal(0, 0.1, (rank, VERTICES, 3))
    courses = np.array([np.sin((k + 1) * np.linspace(0, 3, FRAMES)) for k in range(rank)])
    frames = rng.normal(size=(VERTICES, 3)) + np.einsum("kt,kvi->tvi", courses, shapes)
    return frames + rng.normal(0, noise, frames.shape)


def test_as_many_shapes_are_kept_as_there_are():
    found = principal_shapes(swaying(3), 1e-9)
    assert found.shapes.shape == (3, VERTICES, 3)
    assert found.error < 1e-9
    assert np.abs(found.weights).max() == pytest.approx(1.0)


@pytest.mark.parametrize("error", [0.03, 0.003])
def test_no_vertex_is_farther_off_than_allowed_and_one_shape_less_would_not_do(error):
    frames = swaying(5, noise=0.002)
    found = principal_shapes(frames, error)
    rebuilt = found.base + np.einsum("tk,kvi->tvi", found.weights, found.shapes)
    off = np.linalg.norm(rebuilt - frames, axis=2).max()
    assert off == pytest.approx(found.error, rel=1e-6)
    assert off <= error
    fewer = found.base + np.einsum("tk,kvi->tvi", found.weights[:, :-1], found.shapes[:-1])
    assert np.linalg.norm(fewer - frames, axis=2).max() > error


def test_what_never_moves_needs_no_shape():
    found = principal_shapes(np.repeat(swaying(1)[:1], 4, axis=0), 1e-6)
    assert found.shapes.shape == (0, VERTICES, 3)
    assert found.weights.shape == (4, 0)


def test_a_garment_comes_back_from_its_file(tmp_path):
    import pygltflib

    body, frames = template(0.3), swaying(4)
    count = len(body.joint_names)
    motion = AvatarMotion(
        body.joint_names, np.zeros((FRAMES, count, 3)), np.zeros((FRAMES, 3)), np.zeros((FRAMES, 4), bool), 1 / 24
    )
    faces = np.array([[k, k + 1, k + 2] for k in range(VERTICES - 2)], np.int32)
    normals = vertex_normals(TriangleMesh(body.bind_vertices, body.faces))
    made, error = animated_glb(body, normals, motion, ClothMotion(frames, faces, 1 / 24))
    write_glb_bytes(tmp_path / "m.glb", made)
    scene = pygltflib.GLTF2().load(str(tmp_path / "m.glb"))

    def values(index):
        accessor = scene.accessors[index]
        view = scene.bufferViews[accessor.bufferView]
        kind = {5126: "<f4", 5125: "<u4"}[accessor.componentType]
        width = {"SCALAR": 1, "VEC3": 3}[accessor.type]
        blob = scene.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
        return np.frombuffer(blob, kind).reshape(accessor.count, width)

    node = next(k for k, one in enumerate(scene.nodes) if one.name == "garment")
    assert node in scene.scenes[0].nodes
    primitive = scene.meshes[scene.nodes[node].mesh].primitives[0]
    channel = next(one for one in scene.animations[0].channels if one.target.node == node)
    assert channel.target.path == "weights"
    sampler = scene.animations[0].samplers[channel.sampler]
    np.testing.assert_allclose(values(sampler.input)[:, 0], np.arange(FRAMES) / 24, rtol=1e-6)  # single precision
    targets = np.array([values(one["POSITION"]) for one in primitive.targets])
    weights = values(sampler.output).reshape(FRAMES, len(targets))
    shown = values(primitive.attributes.POSITION) + np.einsum("tk,kvi->tvi", weights, targets)
    assert np.linalg.norm(shown - frames, axis=2).max() <= error + 1e-6
    assert error <= 1e-3
    np.testing.assert_array_equal(values(primitive.indices).reshape(-1, 3), faces)
