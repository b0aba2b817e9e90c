"""Bodies: measurements, landmarks, the avatar. World frame: metres, +Y up, +Z forward, y = 0 the floor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray, freeze
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.notebook import Presented


@dataclass(frozen=True)
class Measurements:
    """Lengths of a body under ISO 8559-1 names.

    Args:
        values: Name -> length [m] (mass, if present, in kg under "mass").
        sigmas: Name -> standard uncertainty in the same unit; a name may be absent.
        sex: "female", "male" or "neutral".
        caveats: Why they are estimates rather than measurements, such as "under clothing"; empty where they are not.
    """

    values: Mapping[str, float]
    sigmas: Mapping[str, float] = field(default_factory=dict)
    sex: str = "neutral"
    caveats: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.sex not in ("female", "male", "neutral"):
            raise InputError(f"sex is {self.sex!r}; expected female, male or neutral")
        for name, value in self.values.items():
            if not 0 < value < 1000:
                raise InputError(f"measurement {name} is {value}; expected a positive number")


@dataclass(frozen=True)
class Avatar(Presented):
    """A body of the project's own template: fixed topology, a skeleton, and named loops and landmarks.

    Args:
        bind_vertices: Shaped body in the bind pose (A-pose) [m], shape (V, 3).
        faces: Shape (F, 3).
        joint_names: J names.
        joints: Joint centres in the bind pose [m], shape (J, 3).
        parents: Index of each joint's parent, -1 for the root, shape (J,).
        weights: Skinning weights, rows sum to 1, shape (V, J).
        pose: Rotation vector of each joint relative to the bind pose [rad], shape (J, 3).
        translation: Of the root [m], shape (3,).
        vertices: Posed body [m], shape (V, 3).
        sex: 0 female ... 1 male.
        landmarks: Name -> vertex index.
        loops: Name -> closed loop of vertex indices.
        parameters: Name -> value of the shape parameters, for the record.
        sigmas: Measurement name -> standard uncertainty with which the body has it [m, kg]; absent where unknown.
        caveats: Why its measurements are estimates, as those of `Measurements`.
    """

    bind_vertices: FloatArray
    faces: IntArray
    joint_names: tuple[str, ...]
    joints: FloatArray
    parents: IntArray
    weights: FloatArray
    pose: FloatArray
    translation: FloatArray
    vertices: FloatArray
    sex: float = 0.5
    landmarks: Mapping[str, int] = field(default_factory=dict)
    loops: Mapping[str, IntArray] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    sigmas: Mapping[str, float] = field(default_factory=dict)
    caveats: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count, bones = len(self.bind_vertices), len(self.joint_names)
        for name, shape, dtype in (
            ("bind_vertices", (count, 3), "f8"),
            ("faces", (None, 3), "i4"),
            ("joints", (bones, 3), "f8"),
            ("parents", (bones,), "i4"),
            ("weights", (count, bones), "f8"),
            ("pose", (bones, 3), "f8"),
            ("translation", (3,), "f8"),
            ("vertices", (count, 3), "f8"),
        ):
            object.__setattr__(self, name, freeze(f"avatar {name}", getattr(self, name), shape, dtype))

    @property
    def mesh(self) -> TriangleMesh:
        """The posed body."""
        return TriangleMesh(self.vertices, self.faces)


@dataclass(frozen=True)
class SkinnedBody:
    """A skinned body of foreign topology, at rest; register the template to its mesh to use it.

    Args:
        vertices: At rest [m], shape (V, 3).
        faces: Shape (F, 3).
        joint_names: J names.
        joints: Joint centres at rest [m], shape (J, 3).
        parents: Index of each joint's parent, -1 for a root, shape (J,).
        weights: Skinning weights, rows sum to 1, shape (V, J).
    """

    vertices: FloatArray
    faces: IntArray
    joint_names: tuple[str, ...]
    joints: FloatArray
    parents: IntArray
    weights: FloatArray

    def __post_init__(self) -> None:
        count, bones = len(self.vertices), len(self.joint_names)
        for name, shape, dtype in (
            ("vertices", (count, 3), "f8"),
            ("faces", (None, 3), "i4"),
            ("joints", (bones, 3), "f8"),
            ("parents", (bones,), "i4"),
            ("weights", (count, bones), "f8"),
        ):
            object.__setattr__(self, name, freeze(f"skinned body {name}", getattr(self, name), shape, dtype))
        if bones == 0 or (self.weights < 0).any() or (abs(self.weights.sum(axis=1) - 1) > 1e-6).any():
            raise InputError("skinned body: every vertex needs weights of at least 0 that sum to 1")
        if (self.parents < -1).any() or (self.parents >= bones).any():
            raise InputError(f"skinned body: a parent is outside -1..{bones - 1}")

    @property
    def mesh(self) -> TriangleMesh:
        """The body at rest."""
        return TriangleMesh(self.vertices, self.faces)


@dataclass(frozen=True)
class MorphableBody:
    """A body of foreign topology at rest and the shapes it can be blended into.

    Args:
        vertices: At rest [m], shape (V, 3); helpers that belong to no surface included.
        surfaces: Name -> triangles, shape (F, 3): "body" and whatever else it has, such as eyes.
        places: Name -> vertices whose middle is a named point, such as a joint, shape (N,).
        targets: Name -> vertices (N,) and how far each of them moves at a share of one [m], shape (N, 3).
    """

    vertices: FloatArray
    surfaces: Mapping[str, IntArray]
    places: Mapping[str, IntArray]
    targets: Mapping[str, tuple[IntArray, FloatArray]]

    def blended(self, shares: Mapping[str, float]) -> FloatArray:
        """Return the vertices with these shares of targets [m], shape (V, 3)."""
        vertices = np.array(self.vertices)
        for name, share in shares.items():
            place, offset = self.targets[name]
            np.add.at(vertices, place, share * offset)
        return vertices


@dataclass(frozen=True)
class LifelikeBody:
    """An avatar with face, fingers and toes: for pictures, while cloth meets the avatar itself.

    Args:
        avatar: The body, of a topology of its own, without landmarks and loops; it is posed as any avatar.
        colors: sRGB of each vertex, shape (V, 3).
    """

    avatar: Avatar
    colors: ByteArray

    def __post_init__(self) -> None:
        count = len(self.avatar.bind_vertices)
        object.__setattr__(self, "colors", freeze("lifelike body colors", self.colors, (count, 3), "u1"))

    @property
    def mesh(self) -> TriangleMesh:
        """The posed body."""
        return TriangleMesh(self.avatar.vertices, self.avatar.faces, self.colors)


@dataclass(frozen=True)
class MovingBody:
    """A body that changes shape or pose, as the collider of a drape.

    Args:
        keyframes: Positions [m], shape (K, V, 3), K >= 1, evenly spaced over the motion; linear in between.
        faces: Shape (F, 3).
    """

    keyframes: FloatArray
    faces: IntArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "keyframes", freeze("keyframes", self.keyframes, (None, None, 3), "f8"))
        object.__setattr__(self, "faces", freeze("faces", self.faces, (None, 3), "i4"))
        if len(self.keyframes) == 0:
            raise InputError("moving body has no keyframe")

    @property
    def final(self) -> TriangleMesh:
        """The body at the end of its motion."""
        return TriangleMesh(self.keyframes[-1], self.faces)
