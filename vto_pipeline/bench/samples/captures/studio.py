"""The scenes that are photographed: the dressed form over its board, and the customer."""

from __future__ import annotations

import numpy as np

from vto_pipeline.bench.samples.captures.board import BOARD, board_picture, board_surface
from vto_pipeline.bench.samples.captures.render import CLOTH, FLOOR, LINEN, RenderScene, Surface, build_scene
from vto_pipeline.bench.samples.captures.textures import cloth_coordinates
from vto_pipeline.bench.samples.garments.shirt import SLEEVE_RADIUS, TRUNK_RADIUS, sleeve_coordinates
from vto_pipeline.bench.samples.solids.form import Form
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

FLOOR_RADIUS = 3.0  # [m]
FLOOR_DROP = 0.0004  # the board lies on the floor; less than the offset of the light rays, or the board would shade it


def dressed_form(form: Form, shirt: TriangleMesh) -> RenderScene:
    """The form in its shirt, the board at its foot, on a dull floor."""
    picture, scale = board_picture(BOARD)
    surfaces = [
        Surface(shirt, CLOTH, shirt_coordinates(form, shirt)),
        Surface(form.mesh, LINEN),
        board_surface(BOARD),
        Surface(floor_mesh(), FLOOR),
    ]
    return build_scene(surfaces, picture, scale)


def shirt_coordinates(form: Form, shirt: TriangleMesh) -> FloatArray:
    """Where each triangle corner lies on the developed cloth, shape (F, 3, 2) [m]."""
    around, along, radius = (a[shirt.faces] for a in sleeve_coordinates(form, shirt.vertices))
    corners = shirt.vertices[shirt.faces]
    middle = corners.mean(axis=1)
    on_sleeve = (np.abs(middle[:, 0]) > 0.165) & (radius.mean(axis=1) < 0.10) & (along.mean(axis=1) > 0.0)
    side = np.where(middle[:, :1] < 0.0, 1.0, 0.0)
    turn = TRUNK_RADIUS * np.arctan2(corners[..., 0], corners[..., 2])
    around = np.where(on_sleeve[:, None], around, turn)
    along = np.where(on_sleeve[:, None], 2.0 + side - along, corners[..., 1])
    girth = 2.0 * np.pi * np.where(on_sleeve, SLEEVE_RADIUS, TRUNK_RADIUS)
    return cloth_coordinates(shirt, around, along, girth)


def floor_mesh() -> TriangleMesh:
    """A disc of triangles, finer towards the middle, just under y = 0."""
    rings, spokes = 48, 96
    radius = FLOOR_RADIUS * np.linspace(0.0, 1.0, rings + 1)[1:] ** 2
    turn = 2.0 * np.pi * np.arange(spokes) / spokes
    x = np.concatenate([[0.0], np.outer(radius, np.sin(turn)).ravel()])
    z = np.concatenate([[0.0], np.outer(radius, np.cos(turn)).ravel()])
    vertices = np.stack([x, np.full_like(x, -FLOOR_DROP), z], axis=1)
    ring, spoke = np.meshgrid(np.arange(rings - 1), np.arange(spokes), indexing="ij")
    a = (1 + ring * spokes + spoke).ravel()
    b = (1 + ring * spokes + (spoke + 1) % spokes).ravel()
    fan = np.stack([np.zeros(spokes), 1 + np.arange(spokes), 1 + (np.arange(spokes) + 1) % spokes], axis=1)
    faces = np.concatenate([fan, np.stack([a, a + spokes, b], 1), np.stack([b, a + spokes, b + spokes], 1)])
    return TriangleMesh(vertices, faces.astype(np.int32))
