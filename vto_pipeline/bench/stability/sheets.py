"""Difficult sheets: steps too large, starts far from rest, bad triangles, loads and units out of scale."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from vto_pipeline.bench.cloth.scenes import grid, isotropic_sheet
from vto_pipeline.bench.stability.case import StabilityCase
from vto_pipeline.cloth.model.build import build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.placement.collapsed_start import expand_collapsed_triangles
from vto_pipeline.geometry.topology import edges, face_areas
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

_COUNT = 10  # vertices a side
_STIFFNESS, _DENSITY = 1000.0, 0.2  # [N/m], [kg/m²]
_BENDING = 0.1  # [N·m] where a sheet must recover: stiff like card, so that few crumples could hold themselves
_DAMPING = 2.0  # [1/s] there: what swings for ever never recovers
_SEED = 136  # of VBD's random vertices
_SPHERE = 0.5  # [m], its radius
_FRAME = 1.0 / 60.0
_STEPS = (10, 30, 60, 240, 2000)  # a second


def sheet_cases() -> Iterator[StabilityCase]:
    """Make all cases of sheets, one after the other."""
    for steps in _STEPS:
        yield replace(_swing(f"h 1/{steps}", *_flat(), h=1.0 / steps), step_tried=True)
    yield _swing("gravity x 100", *_flat(), gravity=100.0 * GRAVITY)
    yield _swing("mm taken as m", *_flat(300.0))
    yield _swing("km taken as m", *_flat(0.0003), falls=False)
    yield _swing("slivers 1e-6", *_narrowed(1e-6))
    yield _swing("zero-area triangles", *_narrowed(0.0))
    yield _swing("duplicate vertices", *_cut())
    yield _swing("two isolated sheets", *_two())
    yield _swing("all pinned", *_flat(), pinned=tuple(range(_COUNT**2)), falls=False)
    yield _rigid()
    for name, start in _STARTS.items():
        rest, faces = _flat()
        yield _recovery(name, rest, faces, start(rest))
    yield _flattened_ball()


def quiet_sheet() -> StabilityCase:
    """A free sheet at rest without gravity, to swing in its plane at its highest frequency."""
    return replace(_swing("highest mode", *_flat(), gravity=0.0, pinned=(), falls=False), damping=0.0)


def _swing(
    name: str,
    rest: FloatArray,
    faces: IntArray,
    *,
    h: float = _FRAME,
    gravity: float = GRAVITY,
    pinned: tuple[int, ...] | None = None,
    falls: bool = True,
) -> StabilityCase:
    """A level sheet held at its first row, or by what is given, and let go for a second."""
    held = np.flatnonzero(rest[:, 2] == rest[:, 2].min()) if pinned is None else np.array(pinned)
    mesh = TriangleMesh(rest, faces)
    fabric = isotropic_sheet(_STIFFNESS, _DENSITY, bending=1e-5)
    model = build_cloth(mesh, RestShape(rest), fabric, pinned=held, gravity=(0.0, -gravity, 0.0))
    hanging = _DENSITY * gravity * float(np.ptp(rest[:, 2])) / _STIFFNESS
    substeps = max(1, round(_FRAME / h))
    return StabilityCase(
        name,
        model,
        rest,
        rest,
        _held_together(mesh),
        h=h,
        substeps=substeps,
        frames=round(1.0 / (h * substeps)),
        sweeps=10,
        strain=0.01 + 5.0 * hanging,
        falls=falls,
    )


def _rigid() -> StabilityCase:
    """The same sheet, without compliance in its plane and without resistance to bending."""
    case = _swing("rigid sheet", *_flat())
    membrane = case.model.constraints[-1]
    rigid = membrane._replace(compliance=np.zeros_like(membrane.compliance))
    return replace(case, model=replace(case.model, constraints=(rigid,)), rigid=True, strain=0.01)


def _recovery(
    name: str, rest: FloatArray, faces: IntArray, start: FloatArray, *, curved: bool = False
) -> StabilityCase:
    """A sheet that must come back to its rest shape, from its start with ties broken, as a simulation does.

    Flat sheets bend by the quadratic model, which knows one shape without forces. Hinges can hold crumples of
    themselves where neighbours have folded over in opposite ways, and then not recovering is right.
    """
    mesh = TriangleMesh(rest, faces)
    fabric = isotropic_sheet(_STIFFNESS, _DENSITY, bending=_BENDING)
    materials = Materials.model_validate({"bending": "hinge" if curved else "isometric"})
    return StabilityCase(
        name,
        build_cloth(mesh, RestShape(rest, curved), fabric, gravity=(0.0, 0.0, 0.0), materials=materials),
        expand_collapsed_triangles(start, rest, mesh.faces),
        rest,
        edges(mesh),
        h=_FRAME / 10,
        substeps=10,
        frames=300,
        sweeps=10,
        damping=_DAMPING,
        recovers=True,
    )


def _flattened_ball() -> StabilityCase:
    """A closed surface with its curvature as its rest angles, pressed into the plane y = 0."""
    from trimesh.creation import icosphere

    ball = icosphere(2, 0.3)
    rest = np.asarray(ball.vertices, dtype=np.float64)
    return _recovery("flattened ball", rest, ball.faces.astype(np.int32), rest * [1.0, 0.0, 1.0], curved=True)


def _flat(side: float = 1.0) -> tuple[FloatArray, IntArray]:
    """A level square [m] about the origin."""
    across, along, faces = grid(_COUNT)
    return side * np.column_stack([across - 0.5, np.zeros(len(across)), along - 0.5]), faces


def _held_together(mesh: TriangleMesh) -> IntArray:
    """Edges of triangles with an area at rest: across any other, nothing holds the cloth together."""
    solid = face_areas(mesh) > 0.0
    return edges(TriangleMesh(mesh.vertices, mesh.faces[solid]))


def _narrowed(width: float) -> tuple[FloatArray, IntArray]:
    """The square with one column of triangles this narrow, as a share of the others."""
    rest, faces = _flat()
    columns = rest[:_COUNT, 0]
    middle = _COUNT // 2
    wide = np.isclose(rest[:, 0], columns[middle])
    rest[wide, 0] = columns[middle - 1] + width * (columns[1] - columns[0])
    return rest, faces


def _cut() -> tuple[FloatArray, IntArray]:
    """The square cut along a column: two vertices at each place of the cut."""
    rest, faces = _flat()
    middle = rest[_COUNT // 2, 0]
    on_cut = np.flatnonzero(rest[:, 0] == middle)
    twin = np.arange(len(rest))
    twin[on_cut] = len(rest) + np.arange(len(on_cut))
    right = rest[faces, 0].mean(axis=1) > middle
    return np.vstack([rest, rest[on_cut]]), np.where(right[:, None], twin[faces], faces).astype(np.int32)


def _two() -> tuple[FloatArray, IntArray]:
    """Two squares, of which the second is held by nothing."""
    rest, faces = _flat()
    return np.vstack([rest, rest + np.array([0.0, -0.2, 2.0])]), np.vstack([faces, faces + len(rest)]).astype(np.int32)


def _on_sphere(rest: FloatArray) -> FloatArray:
    """Every vertex somewhere on a sphere (VBD, Chen et al. 2024)."""
    directions = np.random.default_rng(_SEED).normal(size=rest.shape)
    return _SPHERE * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _inverted(rest: FloatArray) -> FloatArray:
    """Vertices shaken in their plane by more than an edge: about half of the triangles turn over."""
    shaken = np.random.default_rng(_SEED).uniform(-1.5, 1.5, rest.shape) / (_COUNT - 1)
    return _nearly_flat(rest + shaken * [1.0, 0.0, 1.0])


def _nearly_flat(positions: FloatArray) -> FloatArray:
    """A millionth of an edge out of the plane y = 0, in which cloth would stay for ever, like a needle on its tip."""
    edge = 1.0 / (_COUNT - 1)
    return positions + np.outer(1e-6 * edge * np.random.default_rng(_SEED).standard_normal(len(positions)), [0, 1, 0])


_STARTS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "random on a sphere": _on_sphere,
    "inverted triangles": _inverted,
    "folded flat": lambda rest: np.abs(rest) * [1.0, 0.0, 0.0] + rest * [0.0, 0.0, 1.0],
    "collapsed to a line": lambda rest: rest * [1.0, 0.0, 0.0],
    "collapsed to a point": np.zeros_like,
    "stretched 1000:1": lambda rest: _nearly_flat(rest * [1000.0, 1.0, 1.0]),
}
