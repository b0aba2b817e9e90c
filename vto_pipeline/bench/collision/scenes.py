"""Scenes of self-contact, run by `simulate`: crossings at the end, depth and stretch."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.cloth.scenes import (
    FRICTION,
    POPLIN,
    RADIUS,
    SHIRT_DAMPING,
    STIFFNESS,
    isotropic_sheet,
    shirt_on_form,
    sphere,
)
from vto_pipeline.bench.collision.contact_scene import ContactScene, contact_errors
from vto_pipeline.bench.collision.sheets import folded_twice, funnel, square, stacked
from vto_pipeline.bench.timing import clocked, timed
from vto_pipeline.cloth import Box, MeshCollider, Moving, Path, Plane, Sphere
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

BENDING = 1e-5  # [N·m]
LAYERS, SHEETS = 5, 10
SPEEDS = (1.0, 2.0, 4.0, 8.0)  # of a table cloth [m/s]
"""The C-IPC paper's (Li et al. 2021)."""

_FLOOR = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), FRICTION)
_TABLE = Box((0.0, -0.01, 0.0), (0.3, 0.01, 0.3), friction=FRICTION)
_PATIENCE = 20.0  # a run that takes longer is not repeated [s]


def scene_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """All scenes with the default method, once the kernels are compiled."""
    on_ball(8).run()  # until it lies on the ball
    for make in _scenes(quick):
        scene = make()
        yield watch.row(scene.name, "default", scene.settings, len(scene.rest), partial(_measure, scene))


def on_ball(count: int, **settings: Value) -> ContactScene:
    """The square metre of `bench.cloth.scenes.sphere`, N x N vertices, that other programs are measured on."""
    plain = sphere(count)
    mesh = TriangleMesh(plain.start, plain.model.faces)
    ball = Sphere((0.0, 0.0, 0.0), RADIUS, FRICTION)
    return ContactScene(
        f"sphere {count}", mesh, plain.rest, isotropic_sheet(STIFFNESS), [ball], plain.seconds, settings=settings
    )


def folded_towel(count: int, seconds: float = 1.5) -> ContactScene:
    """A towel of N x N / 2 vertices folded in four, let go over a plane."""
    start, flat, faces = folded_twice(count, 0.5, 0.25, 0.012)
    fabric = isotropic_sheet(STIFFNESS, bending=BENDING)
    return ContactScene(f"folded twice {count}", TriangleMesh(start, faces), flat, fabric, [_FLOOR], seconds)


def ball_on_sheets(count: int, seconds: float = 1.5) -> ContactScene:
    """Ten squares of N x N vertices over a plane, and a ball that falls on them and comes to rest in them."""
    radius, height, gap = 0.08, 0.15, 0.004
    flat, faces = stacked(SHEETS, square(count, 0.4), gap)
    top = radius + gap * (SHEETS + 1)
    low = radius + 0.5 * gap * SHEETS  # where the ball stops: it leaves each layer 2 mm
    fall = np.sqrt(2.0 * height / GRAVITY)
    times = np.concatenate([np.linspace(0.0, fall, 13), fall + np.linspace(0.0, 0.1, 7)[1:]])
    drop = top + height - 0.5 * GRAVITY * np.minimum(times, fall) ** 2
    late = np.clip((times - fall) / 0.1, 0.0, 1.0)
    drop = np.where(times > fall, top + (low - top) * late * (2.0 - late), drop)
    path = Path(times, np.column_stack([0.0 * drop, drop, 0.0 * drop]))
    ball = Moving(Sphere((0.0, 0.0, 0.0), radius, FRICTION), path)
    fabric = isotropic_sheet(STIFFNESS, bending=BENDING)
    name = f"ball on ten sheets {count}"
    return ContactScene(name, TriangleMesh(flat, faces), flat, fabric, [_FLOOR, ball], seconds)


def twisted(count: int, seconds: float = 2.0) -> ContactScene:
    """A band of N x N vertices, whose ends turn by a full turn each, against each other."""
    length, width = 0.6, 0.2
    flat, faces = square(count, length, width)
    ends = np.flatnonzero(np.abs(flat[:, 0]) > 0.5 * length - 1e-9)

    def path(time: float) -> FloatArray:
        share = min(time / (0.8 * seconds), 1.0)
        x, y, z = flat[ends].T
        turn = 2.0 * np.pi * share * np.sign(x)
        nearer = 1.0 - 0.35 * share
        return np.column_stack([nearer * x, y * np.cos(turn) - z * np.sin(turn), y * np.sin(turn) + z * np.cos(turn)])

    fabric = isotropic_sheet(STIFFNESS, bending=BENDING)
    still: dict[str, Value] = {"damping": 2.0}
    mesh = TriangleMesh(flat, faces)
    return ContactScene(f"two full turns {count}", mesh, flat, fabric, [], seconds, tuple(ends), path, still)


def through_funnel(count: int, seconds: float = 1.5) -> ContactScene:
    """A square of N x N vertices over a funnel, drawn down through its throat by the middle."""
    start, faces = square(count, 0.4)
    start = start + np.array([0.0, 0.13, 0.0])
    middle = np.flatnonzero(np.linalg.norm(start[:, [0, 2]], axis=1) < 0.03)
    fabric = isotropic_sheet(STIFFNESS, bending=BENDING)

    def path(time: float) -> FloatArray:
        return start[middle] - np.array([0.0, 0.5 * min(time / (0.9 * seconds), 1.0), 0.0])

    mesh, solid = TriangleMesh(start, faces), MeshCollider(funnel(), FRICTION)
    return ContactScene(f"funnel {count}", mesh, start, fabric, [solid], seconds, tuple(middle), path)


def table_cloth(count: int, speed: float) -> ContactScene:
    """A square of N x N vertices on a table top of 20 mm, drawn off by one edge at this speed [m/s]."""
    flat, faces = square(count, 0.5)
    start = flat + np.array([0.0, 0.003, 0.0])
    edge = np.flatnonzero(flat[:, 0] > 0.25 - 1e-9)

    def path(time: float) -> FloatArray:
        return start[edge] + np.array([speed * time, 0.0, 0.0])

    fabric = isotropic_sheet(STIFFNESS, bending=BENDING)
    name, seconds = f"table cloth {count}, {speed:g} m/s", 0.5 / speed
    return ContactScene(name, TriangleMesh(start, faces), flat, fabric, [_TABLE], seconds, tuple(edge), path)


def pile(count: int, seconds: float = 2.0) -> ContactScene:
    """Five squares of N x N vertices, one on the other on a plane."""
    flat, faces = stacked(LAYERS, square(count, 0.2), 0.003)
    fabric = isotropic_sheet(STIFFNESS, bending=BENDING)
    return ContactScene(f"pile of five {count}", TriangleMesh(flat, faces), flat, fabric, [_FLOOR], seconds)


def hung_shirt(edge_mm: float, seconds: float = 1.0) -> ContactScene:
    """The sample shirt on its form, in poplin, edges of about this length [mm]."""
    mesh, form = shirt_on_form(edge_mm)
    body, damped = MeshCollider(form, FRICTION), dict[str, Value](damping=SHIRT_DAMPING)
    return ContactScene(f"shirt {edge_mm:g} mm", mesh, mesh.vertices, POPLIN, [body], seconds, settings=damped)


def _scenes(quick: bool) -> Iterator[Callable[[], ContactScene]]:
    if quick:
        yield partial(on_ball, 16)
        yield partial(folded_towel, 16, 0.5)
        yield partial(ball_on_sheets, 8, 0.4)
        yield partial(twisted, 16, 0.5)
        yield partial(through_funnel, 12, 0.5)
        yield partial(table_cloth, 16, 4.0)
        yield partial(pile, 6, 0.5)
        return
    for count in (32, 64, 128):
        yield partial(on_ball, count)
        yield partial(on_ball, count, substeps=0.6)  # 1/36 s
    yield partial(folded_towel, 48)
    yield partial(ball_on_sheets, 24)
    yield partial(twisted, 48)
    yield partial(through_funnel, 40)
    for speed in SPEEDS:
        yield partial(table_cloth, 40, speed)
    yield partial(pile, 16)
    yield partial(hung_shirt, 20.0)


def _measure(scene: ContactScene) -> Measured:
    """Return the time and the errors of a scene."""
    _, compile_s = clocked(replace(scene, seconds=1.0 / 60.0).run)
    ended, timing = timed(scene.run, budget=_PATIENCE)
    return replace(timing, compile_s=compile_s), contact_errors(scene, ended)
