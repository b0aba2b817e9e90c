"""Quality of a registration, and whether the scan shows a body at all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vto_pipeline.avatar.measuring.population import population
from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.template.template import JOINT_KINDS
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.topology import edge_face_counts, face_areas, surface_area
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_NEAR_M = 0.030
"""So near an end of the body lies to its scan before the body is displaced onto it."""
EXPLAINED_M = 0.010
"""Farther scan points are something else: a stand, a floor, hair."""
CORE = 0.3
"""A vertex belongs to trunk and limbs when it belongs less than this to head, hands and feet."""
_TRUNK = 0.8
_MIN_TRUNK, _MIN_LIMB = 0.3, 0.5
_WHOLE_TRUNK = 0.8
"""Of a trunk seen from one side only there is half; a dress form shows more than nine tenths."""
_LIKE_A_BODY = 2 / 3
"""So much of a person lies near the model's body: of people 94 % and more, of a dress form on its stand 89 %."""
_STANDS_M, _REACH = 0.75, 1.2
"""Children who stand are taller than that [m]; no one's arms reach that many times their stature."""
_ENDS = ("head", "wrist", "ankle")
"""Joints of a person's ends: the head, the hands and the feet."""
_NO_END, _CROTCH_M = 0.05, 0.03
_CUFF_M, CUFFS = 0.15, 3
"""Girth of what an arm or a neck goes through; a garment of the upper body has three: for the neck and both arms."""
_STRAY = 0.25
"""Of a limb's surface: so much that lies elsewhere and faces inwards is that limb, inside out; some of it lies near."""
_POINTS = 5000
_BUILD = ("shoulder_height", "back_shoulder_width", "outer_arm_length", "hip_height", "inside_leg", "knee_height")
_BUILD_M, _ODD = 0.02, 4.0
"""How well these are read off a bent body [m], and how many standard deviations no person is away."""


def refuse_non_body(scan: TriangleMesh, space: ShapeSpace, vertices: FloatArray, max_mean_mm: float) -> None:
    """Refuse a scan that is not a body.

    Raises:
        AvatarError: the scan lies too far from any body, or shows too little of the trunk; or a limb is inside out.
    """
    points, normals, _ = sample_surface(scan, _POINTS, 0)
    face, _, distance = closest_points(points, vertices, space.base.faces)
    mean = 1e3 * float(distance.mean())
    share = _trunk_covered(scan, space, vertices)
    if mean > max_mean_mm or share < _MIN_TRUNK:
        raise AvatarError(
            f"this is not a body, or too little of one: mean distance {mean:.1f} mm (at most {max_mean_mm}), "
            f"{share:.0%} of the trunk found (at least {_MIN_TRUNK:.0%})",
            hint="the scan must show the trunk from all sides, in metres, +Y up, its normals outwards",
        )
    body = TriangleMesh(vertices, space.base.faces)
    each = _POINTS / surface_area(scan)  # points for an area
    for limb, own in _limbs(space).items():
        whole: NDArray[np.bool_] = np.all(own[body.faces], axis=1)
        stray = whole[face] & (distance > EXPLAINED_M)
        expected = each * face_areas(body)[whole].sum()
        # what encloses a volume faces away from its middle
        outward = ((points[stray] - points[stray].mean(axis=0)) * normals[stray]).sum() if stray.any() else 0.0
        if stray.sum() > _STRAY * expected and outward < 0:
            raise AvatarError(
                f"the surface of the {limb} is inside out", hint="flip its faces, so that normals point outwards"
            )


def refuse_shape_of_no_body(scan: TriangleMesh, space: ShapeSpace, posed: FloatArray) -> None:
    """Refuse a solid as tall as a person that no pose and build explains.

    Args:
        scan: Its surface [m].
        space: The model.
        posed: The model's body that fits it best, not yet displaced onto it [m], shape (V, 3).

    Raises:
        AvatarError: too little of the scan lies near that body.
    """
    points, _, _ = sample_surface(scan, _POINTS, 0)
    face, _, distance = closest_points(points, posed, space.base.faces)
    core = extremity_weights(space.base)[space.base.faces].mean(axis=1)[face] < CORE
    share = float((distance[core] < EXPLAINED_M).mean()) if core.any() else 0.0
    if share < _LIKE_A_BODY:
        raise AvatarError(
            f"this is not a body: no build and pose comes near its shape. Within {1e3 * EXPLAINED_M:.0f} mm of the "
            f"nearest one lies {share:.0%} of it (at least {_LIKE_A_BODY:.0%})",
            hint=_likely_cause(scan),
        )


def _likely_cause(scan: TriangleMesh) -> str:
    """Say why the model comes nowhere near a scan that stands along +Y: its unit, what is beside it, or clothes."""
    across, height, deep = np.ptp(scan.vertices, axis=0)
    if height < _STANDS_M:
        return f"as read it is {height:.2f} m tall; if its unit is another, say so: {{file: ..., unit: in}}"
    if max(across, deep) > _REACH * height:
        return f"it is {max(across, deep):.2f} m wide and {height:.2f} m tall; remove what stands beside the body"
    return "set clothed: true when the person wears loose clothes"


def refuse_garment(scan: TriangleMesh, space: ShapeSpace, vertices: FloatArray) -> None:
    """Refuse what goes round a trunk: it has its shape, but opens for neck, arms and legs and shows none of their ends.

    Args:
        scan: In metres.
        space: The model.
        vertices: The body registered to the scan [m], shape (V, 3).

    Raises:
        AvatarError: the scan shows neither crotch nor head, hands or feet, and is open for neck and arms. A trunk that
            was cropped so has the same shape, and is refused with it. What has legs, as a suit, is taken for a body.
    """
    joints = [k for k, kind in enumerate(JOINT_KINDS) if kind in _ENDS]
    ends = (space.base.weights[:, joint] > _TRUNK for joint in joints)
    crotch = vertices[[space.base.landmarks["crotch_point"]]]
    between_legs = closest_points(crotch, scan.vertices, scan.faces)[2][0] < _CROTCH_M
    if between_legs or any(_shown(scan, vertices[own]) > _NO_END for own in ends):
        return
    cuffs = wide_openings(scan)
    if cuffs >= CUFFS:
        raise AvatarError(
            "this looks like a garment, not a body: it shows neither crotch nor head, hands or feet, and is open in "
            f"{cuffs} places",
            hint="scan the legs, the head or a hand too; a dress form may also have its neck and arms closed",
        )


def refuse_implausible_build(read: Measurements, lean: float) -> None:
    """Refuse a bent body that was not reconstructed: its lengths are implausible.

    Args:
        read: What was measured on it.
        lean: The largest turn of a part of trunk and legs away from upright [rad].

    Raises:
        AvatarError: a length lies farther from what people of this stature have than pose and survey explain.
    """
    people = population(read.sex)
    tall = float(people.mean[people.names.index("stature")])
    usual = people.given({"stature": tall}, {})
    for name in _BUILD:
        k = usual.names.index(name)
        # relative to stature, so that children have it too
        away = read.values[name] * tall / read.values["stature"] - usual.mean[k]
        if abs(away) > _ODD * np.hypot(np.sqrt(usual.covariance[k, k]), _BUILD_M):
            raise AvatarError(
                f"the body leans {np.rad2deg(lean):.0f} degrees and cannot be reconstructed: its {name} would be "
                f"{100 * read.values[name]:.0f} cm at a stature of {100 * read.values['stature']:.0f} cm",
                hint="scan it standing upright, with the arms held off the body",
            )


def report_registration(scan: TriangleMesh, space: ShapeSpace, vertices: FloatArray, job: Job) -> list[str]:
    """Return what the scan hides; measure how far it lies from the body, at points that the fit has not seen."""
    faces = space.base.faces
    points, _, _ = sample_surface(scan, _POINTS, job.seed + 1)
    face, _, distance = closest_points(points, vertices, faces)
    core = extremity_weights(space.base)[faces].mean(axis=1)[face] < CORE
    explained = distance < EXPLAINED_M
    for kind, which in (("", slice(None)), ("core_", core), ("explained_", explained)):
        part = distance[which] * 1e3
        if len(part):
            job.measure(
                **{
                    f"{kind}mean_mm": round(float(part.mean()), 3),
                    f"{kind}rms_mm": round(float(np.sqrt((part**2).mean())), 3),
                    f"{kind}p95_mm": round(float(np.quantile(part, 0.95)), 3),
                }
            )
    job.measure(explained_share=round(float(explained.mean()), 3))
    trunk = _trunk_covered(scan, space, vertices)
    job.measure(trunk_covered=round(trunk, 3))
    hidden = []
    if trunk < _WHOLE_TRUNK:
        hidden.append("part of the trunk not seen")
        job.warn(
            f"{trunk:.0%} of the trunk is in the scan: its girths are estimates. Scan the body from all sides, or "
            "check with a tape before choosing a size by it"
        )
    for limb, own in _limbs(space).items():
        share = _shown(scan, vertices[own])
        if share < _MIN_LIMB:
            hidden.append(f"{limb} not seen")
            job.warn(
                f"{share:.0%} of the {limb} is in the scan: its measurements are estimates for a body of this size"
            )
    return hidden


def extremity_weights(body: Avatar) -> FloatArray:
    """Return how much each vertex belongs to head, hands and feet, 0 to 1, shape (V,)."""
    ends = np.flatnonzero(np.isin(JOINT_KINDS, _ENDS))
    share: FloatArray = body.weights[:, ends].sum(axis=1)
    return share


def _limbs(space: ShapeSpace) -> dict[str, NDArray[np.bool_]]:
    """Return arm or leg -> which vertices are its own, without hand or foot, shape (V,)."""
    names = space.base.joint_names
    return {
        f"{side} {limb}": space.base.weights[:, [names.index(f"{side}_{joint}") for joint in joints]].sum(axis=1)
        > _TRUNK
        for side in ("left", "right")
        for limb, joints in {"arm": ("shoulder", "elbow"), "leg": ("hip", "knee")}.items()
    }


def wide_openings(mesh: TriangleMesh) -> int:
    """Return how many openings of a mesh in metres are wide enough for an arm or a neck."""
    return int((_rims(mesh) > _CUFF_M).sum())


def _rims(mesh: TriangleMesh) -> FloatArray:
    """Return the length of each connected piece of the boundary [m]; faces may be turned against each other."""
    edges, faces = edge_face_counts(mesh)
    rim = edges[faces == 1]
    links = coo_matrix((np.ones(len(rim)), rim.T), shape=(len(mesh.vertices),) * 2)
    piece = connected_components(links, directed=False)[1][rim[:, 0]]
    sides = np.linalg.norm(np.diff(mesh.vertices[rim], axis=1)[:, 0], axis=1)
    return np.asarray(np.bincount(piece, sides), dtype=float)


def _trunk_covered(scan: TriangleMesh, space: ShapeSpace, vertices: FloatArray) -> float:
    names = space.base.joint_names
    trunk = space.base.weights[:, [names.index(n) for n in ("pelvis", "spine", "chest")]].sum(axis=1) > _TRUNK
    return _shown(scan, vertices[trunk])


def _shown(scan: TriangleMesh, vertices: FloatArray) -> float:
    """Return the share of some vertices that the scan shows."""
    return float((closest_points(vertices, scan.vertices, scan.faces)[2] < EXPLAINED_M).mean())
