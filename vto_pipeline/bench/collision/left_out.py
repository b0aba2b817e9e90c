"""Work left out in scenes: time saved, and difference of the results."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.cloth.scenes import STIFFNESS, hang, isotropic_sheet
from vto_pipeline.bench.collision.contact_scene import ContactScene
from vto_pipeline.bench.collision.scenes import folded_towel, hung_shirt, on_ball, pile
from vto_pipeline.bench.measures import PATIENCE, saved
from vto_pipeline.bench.timing import clocked, timed
from vto_pipeline.model.mesh import TriangleMesh


def collision_left_out_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """A flat sheet that hangs, in short and in long steps, one on a ball, a fold, a pile, and a shirt on its form."""
    for make in _scenes(quick):
        scene = make()
        yield watch.row(scene.name, "default", scene.settings, len(scene.rest), partial(_measure, scene))


def hung(count: int, name: str | None = None, **settings: Value) -> ContactScene:
    """The square of `bench.cloth.scenes.hang`, which cannot reach itself, by these settings of `simulate`."""
    plain = hang(count)
    held = tuple(int(i) for i in np.flatnonzero(plain.model.inverse_mass == 0.0))
    mesh = TriangleMesh(plain.start, plain.model.faces)
    return ContactScene(
        name or plain.name, mesh, plain.rest, isotropic_sheet(STIFFNESS), [], plain.seconds, held, settings=settings
    )


def _scenes(quick: bool) -> Iterator[Callable[[], ContactScene]]:
    if quick:
        yield partial(hung, 12)
        yield partial(on_ball, 12)
        return
    yield partial(hung, 64)
    yield partial(hung, 64, "hang 64, long steps", substeps=0.25)
    yield partial(on_ball, 32)
    yield partial(folded_towel, 48)
    yield partial(pile, 16)
    yield partial(hung_shirt, 20.0)


def _measure(scene: ContactScene) -> Measured:
    """Return the time without what is not needed, the share of the whole that this saves, and the difference.

    Of a cloth that was never near itself, also the share of the time that knowing this took.
    """
    moment = replace(scene, seconds=1.0 / 60.0)
    compile_s = sum(clocked(partial(moment.run, force_all=every))[1] for every in (False, True))
    less, timing, found = saved(lambda every: scene.run(force_all=every), lambda ended: ended.positions)
    counters = cast(Mapping[str, float], less.report["self_contact"])
    found |= {
        "searches_left_out_share": 1.0 - counters["searched"] / counters["asked"],
        "impacts_left_out_share": counters["impacts_known"] / max(counters["impacts"] + counters["impacts_known"], 1.0),
    }
    if counters["impacts"] + counters["impacts_known"] == 0:
        _, bare = timed(partial(scene.run, self_collision=False), budget=PATIENCE)
        found["proof_share"] = 1.0 - bare.seconds / timing.seconds
    return replace(timing, compile_s=compile_s), found
