"""Shape, pose and place of the template, the unknowns of a registration."""

from __future__ import annotations

from dataclasses import dataclass

from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.model.skinning import joint_transforms, linear_blend_skinning
from vto_pipeline.model.arrays import FloatArray


@dataclass(frozen=True)
class Fit:
    """Where the registration stands.

    Args:
        parameters: Of the shape space, shape (P,).
        pose: Rotation vectors, shape (J, 3).
        translation: Shape (3,).
        expected: Parameters about which people vary: of a body as large as the scan, shape (P,).
    """

    parameters: FloatArray
    pose: FloatArray
    translation: FloatArray
    expected: FloatArray


def posed_vertices(space: ShapeSpace, fit: Fit) -> FloatArray:
    """Return the posed vertices, shape (V, 3)."""
    rotation, offset = joint_transforms(space.joints(fit.parameters), space.base.parents, fit.pose)
    return linear_blend_skinning(space.vertices(fit.parameters), space.base.weights, rotation, offset) + fit.translation
