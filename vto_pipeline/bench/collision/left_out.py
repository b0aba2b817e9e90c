"""What leaving out what a scene does not need saves, and what difference it makes: the same scenes with all of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.collision.contact_scene import ContactScene
from vto_pipeline.bench.collision.scenes import folded, on_ball, pile, shirt_on_form
from vto_pipeline.bench.scenes import STIFFNESS, hang, isotropic
from vto_pipeline.bench.timing import timed
from vto_pipeline.model.mesh import TriangleMesh

_PATIENCE = 20.0  # a run that takes longer is not repeated [s]


def left_out_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """A flat sheet that hangs, in short and in long steps, one on a ball, a fold, a pile, and a shirt on its form."""
    for make in _scenes(quick):
        scene = make()
        yield watch.row(scene.name, "default", scene.settings, len(scene.rest), partial(_measure, scene))


def hung(count: int, name: str | None = None, **settings: Value) -> ContactScene:
    """The square of `bench.scenes.hang`, which cannot reach itself, by these settings of `simulate`."""
    plain = hang(count)
    held = tuple(int(i) for i in np.flatnonzero(plain.model.inverse_mass == 0.0))
    mesh = TriangleMesh(plain.start, plain.model.faces)
    return ContactScene(
        name or plain.name, mesh, plain.rest, isotropic(STIFFNESS), [], plain.seconds, held, settings=settings
    )


def _scenes(quick: bool) -> Iterator[Callable[[], ContactScene]]:
    if quick:
        yield partial(hung, 12)
        yield partial(on_ball, 12)
        return
    yield partial(hung, 64)
    yield partial(hung, 64, "hang 64, long steps", substeps=0.25)
    yield partial(on_ball, 32)
    yield partial(folded, 48)
    yield partial(pile, 16)
    yield partial(shirt_on_form, 20.0)


def _measure(scene: ContactScene) -> Measured:
    """Return the time without what is not needed, the share of the whole that this saves, and the difference.

    Of a cloth that was never near itself, also the share of the time that knowing this took.
    """
    began = time.perf_counter()
    for every in (False, True):
        replace(scene, seconds=1.0 / 60.0).run(force_all=every)
    compile_s = time.perf_counter() - began
    less, timing = timed(scene.run, budget=_PATIENCE)
    whole, of_whole = timed(partial(scene.run, force_all=True), budget=_PATIENCE)
    apart = np.linalg.norm(less.positions - whole.positions, axis=1)
    tally = cast(Mapping[str, float], less.report["self_contact"])
    found = {
        "saved_share": 1.0 - timing.seconds / of_whole.seconds,
        "difference_mm": float(1e3 * apart.max()),
        "whole_s": of_whole.seconds,
        "searches_left_out_share": 1.0 - tally["searched"] / tally["asked"],
        "impacts_left_out_share": tally["impacts_known"] / max(tally["impacts"] + tally["impacts_known"], 1.0),
    }
    if tally["impacts"] + tally["impacts_known"] == 0:
        _, bare = timed(partial(scene.run, self_collision=False), budget=_PATIENCE)
        found["proof_share"] = 1.0 - bare.seconds / timing.seconds
    return replace(timing, compile_s=compile_s), found
