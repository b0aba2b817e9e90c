"""The avatar with a face, ears, fingers and toes: for pictures.

Up to the rows of neck, wrists and ankles it is the avatar itself, vertex by vertex. So every girth there is the
avatar's, it moves as the avatar does, and cloth that lies on the one lies on the other.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.avatar.lifelike.complexion import colors_of
from vto_pipeline.avatar.lifelike.graft import Grafted, beyond, fit_part, strip
from vto_pipeline.avatar.lifelike.phenotype import shares
from vto_pipeline.avatar.lifelike.placement import Donor, Part, place_parts
from vto_pipeline.avatar.measuring.tape import mass_reading
from vto_pipeline.avatar.model.pose import posed_vertices
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.closest import barycentric, closest_points
from vto_pipeline.geometry.intersections import meeting_vertices, self_intersections
from vto_pipeline.geometry.smooth import neighbour_mean
from vto_pipeline.geometry.topology import boundary_loops, submesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, LifelikeBody, MorphableBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import SKIN
from vto_pipeline.model.settings import Config

_GROWTH = np.array([(0.75, 1.0), (1.10, 5.0), (1.38, 10.0), (1.50, 12.0), (1.60, 14.0)])
"""Stature [m] and age [years] in the middle of both sexes' growth (WHO 2006 and 2007), rounded."""
_GROWN_YEARS = 30.0
_ROUNDS = 30
"""Of smoothing what crosses itself, at most."""
_LID, _CLEAR = (0.9, 1.25), 1.03
"""In an eye's radii: between which lids and sockets lie, and where they begin when the eye does not cross them."""


_Channel = Annotated[int, Field(ge=0, le=255)]
Rgb = tuple[_Channel, _Channel, _Channel]


class LifelikeConfig(Config):
    """Settings of the lifelike body."""

    age_years: float | None = Field(
        default=None,
        ge=1,
        le=90,
        description="Age that face, hands and feet show; absent: 30, or a child's by its stature",
    )
    skin: Rgb = Field(default=SKIN, description="Colour of the skin, sRGB")
    hair: Rgb | None = Field(default=(74, 60, 52), description="Colour of the short hair, sRGB; null: none")


def lifelike_body(avatar: Avatar, library: MorphableBody, config: LifelikeConfig, job: Job) -> LifelikeBody:
    """Give an avatar the head, the hands and the feet of a person of its sex, age and build.

    Args:
        avatar: Any of our bodies.
        library: Where they come from.
        config: Settings.
        job: Takes the age and the build that were chosen.

    Raises:
        InputError: the library lacks a shape or a named point.
    """
    rest = TriangleMesh(avatar.bind_vertices, avatar.faces)
    stature = float(np.ptp(rest.vertices[:, 1]))
    build = mass_reading(rest.vertices, rest.faces).value / stature**2
    age = config.age_years or _age_of(stature)
    job.measure(age_years=age, body_mass_index=build)
    try:
        vertices = _round_eyes(library, library.blended(shares(avatar.sex, age, build)))
        places = {name: vertices[place].mean(axis=0) for name, place in library.places.items()}
        colors = colors_of(library, vertices, config.skin, config.hair)
        surface = np.concatenate(list(library.surfaces.values()))
        whole = TriangleMesh(vertices, surface, colors)
        donor = submesh(whole, np.ones(len(surface), dtype=bool))[0]  # without helpers
        parts = place_parts(avatar, Donor(donor, places))
    except KeyError as missing:
        raise InputError(f"the data for lifelike bodies have no {missing}") from None
    return _assembled(avatar, rest, donor, parts, config)


def _round_eyes(library: MorphableBody, vertices: FloatArray) -> FloatArray:
    """Return the vertices with lids and sockets outside the eyes that they hold [m], shape (V, 3)."""
    skin = np.unique(library.surfaces["body"])
    cleared = np.array(vertices)
    for name, surface in library.surfaces.items():
        if name == "body":
            continue
        eye = vertices[np.unique(surface)]
        middle = (eye.min(axis=0) + eye.max(axis=0)) / 2
        radius = np.linalg.norm(eye - middle, axis=1).max()
        off = vertices[skin] - middle
        away = np.linalg.norm(off, axis=1)
        inside = away < _LID[1] * radius
        apart = np.interp(away[inside], np.multiply(_LID, radius), (_CLEAR * radius, _LID[1] * radius))
        cleared[skin[inside]] = middle + off[inside] * (apart / away[inside])[:, None]
    return cleared


def _age_of(stature: float) -> float:
    if stature >= _GROWTH[-1, 0]:
        return _GROWN_YEARS
    return float(np.interp(stature, *_GROWTH.T))


def _assembled(
    avatar: Avatar,
    rest: TriangleMesh,
    donor: TriangleMesh,
    parts: list[Part],
    config: LifelikeConfig,
) -> LifelikeBody:
    gone = np.any([beyond(rest, part.seat) for part in parts], axis=0)
    trunk, source = submesh(rest, ~gone[rest.faces].any(axis=1))
    vertices, faces = [trunk.vertices], [trunk.faces]
    weights = [avatar.weights[source]]
    painted = [np.tile(np.array(config.skin, dtype=np.uint8), (len(source), 1))]
    ends = [trunk.faces[:0]]
    rims = boundary_loops(trunk)
    first = len(source)
    for part in parts:
        grafted = fit_part(rest, part.seat, replace(donor, vertices=part.placed), part.tip)
        mesh = grafted.mesh
        assert mesh.colors is not None
        rim = next(rim for rim in rims if source[rim[0]] in part.seat.row)
        other = max(boundary_loops(mesh), key=len)
        both = np.concatenate([trunk.vertices, mesh.vertices])
        closing = strip(both, rim, other + len(source), part.seat.axis)
        ends.append(np.where(closing >= len(source), closing - len(source) + first, closing))
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + np.int32(first))
        weights.append(_weights(avatar, rest, grafted, part))
        painted.append(mesh.colors)
        first += len(mesh.vertices)
    grown = TriangleMesh(np.concatenate(vertices), np.concatenate([*faces, *ends]).astype(np.int32))
    body = _untangled(grown, np.arange(first) >= len(source))
    whole = replace(
        avatar,
        bind_vertices=body,
        faces=grown.faces,
        weights=np.concatenate(weights),
        vertices=body,
        landmarks={},
        loops={},
    )
    posed = posed_vertices(whole, avatar.pose, avatar.translation)
    posed[: len(source)] = avatar.vertices[source]
    return LifelikeBody(replace(whole, vertices=posed), np.concatenate(painted))


def _untangled(mesh: TriangleMesh, movable: NDArray[np.bool_]) -> FloatArray:
    """Return the vertices with those of faces that cross each other smoothed until none do, or rounds are spent.

    Some shapes of the data have toes that touch, and a wing of the nose in its septum.
    """
    mean, vertices = neighbour_mean(mesh), np.array(mesh.vertices)
    for _ in range(_ROUNDS):
        pairs = self_intersections(TriangleMesh(vertices, mesh.faces))
        near = meeting_vertices(pairs, mesh.faces, len(vertices)) & movable
        if not near.any():
            break
        vertices[near] += 0.5 * (mean @ vertices - vertices)[near]
    return vertices


def _weights(avatar: Avatar, rest: TriangleMesh, grafted: Grafted, part: Part) -> FloatArray:
    """Return skinning weights of a part: the avatar's near the row, those of its joint beyond."""
    face, nearest, _ = closest_points(grafted.mesh.vertices, rest.vertices, rest.faces)
    corners = rest.faces[face]
    share = np.maximum(barycentric(nearest, rest.vertices[corners]), 0.0)
    carried = np.einsum("nk,nkj->nj", share / share.sum(axis=1, keepdims=True), avatar.weights[corners])
    own = np.zeros(len(avatar.joint_names))
    own[avatar.joint_names.index(part.joint)] = 1.0
    return carried + grafted.own[:, None] * (own - carried)
