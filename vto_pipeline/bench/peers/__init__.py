"""Other programs on the scenes of `bench.cloth.scenes`, beside the default method in the same hour.

peer: what such a program is, and how it is clocked
mujoco_flex, position_based, blender_cloth: one program each
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.cloth.scenes import Scene, hang, measures, sphere
from vto_pipeline.bench.cloth.solvers import timed_run
from vto_pipeline.bench.peers.peer import Peer, measure_peer
from vto_pipeline.bench.report_card.fronts import Trade
from vto_pipeline.bench.timing import Timing
from vto_pipeline.cloth.dynamics.stepper import StepConfig
from vto_pipeline.errors import DivergedError, MissingDependencyError

_OWN_SUBSTEPS = (0.25, 0.6, 1.0)
_FINE_SUBSTEPS = 4.0  # of the reference, which tells how far the cloth is stretched by its weight
_PATIENCE = 20.0  # a run that takes longer is not repeated [s]


def _mujoco(scene: Scene) -> Sequence[Mapping[str, Value]]:
    substeps = (1,) if scene.ball is None else (1, 4)
    return [{"substeps": steps, "self_collision": scene.ball is not None} for steps in substeps]


def _position_based(scene: Scene) -> Sequence[Mapping[str, Value]]:
    return [{"substeps": steps, "self_collision": False} for steps in (20, 100)]


def _blender(scene: Scene) -> Sequence[Mapping[str, Value]]:
    return [{"quality": quality, "self_collision": scene.ball is not None} for quality in (5, 10)]


PEERS = (
    Peer("MuJoCo", "mujoco", "vto_pipeline.bench.peers.mujoco_flex", _mujoco),
    Peer("PositionBasedDynamics", "pypbd", "vto_pipeline.bench.peers.position_based", _position_based),
    Peer("Blender", "bpy", "vto_pipeline.bench.peers.blender_cloth", _blender),
)
"""To add one: its file, with `start(scene, settings)`, and a line here."""


def rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Measure what is installed.

    Raises:
        MissingDependencyError: none of them is.
    """
    found = [peer for peer in PEERS if peer.installed]
    if not found:
        raise MissingDependencyError("none of the peers is installed", hint="pip install 'vto-pipeline[peers]'")
    for absent in (peer for peer in PEERS if not peer.installed):
        watch(f"{absent.name} is left out: no package {absent.package}")
    _own(sphere(8), {"self_collision": True})  # compiles
    for scene in _scenes(quick):
        alone: dict[str, Value] = {"self_collision": scene.ball is not None}
        yield watch.row(scene.name, "default", alone, len(scene.start), partial(_own, scene, alone))
        for substeps in (*_OWN_SUBSTEPS, _FINE_SUBSTEPS):
            own: dict[str, Value] = {**alone, "substeps": substeps}
            method = "reference" if substeps == _FINE_SUBSTEPS else "even steps"
            yield watch.row(scene.name, method, own, len(scene.start), partial(_own, scene, own))
        for peer in found:
            for settings in peer.budgets(scene):
                yield watch.row(
                    scene.name, peer.name, settings, len(scene.start), partial(measure_peer, peer, scene, settings)
                )


def _scenes(quick: bool) -> tuple[Scene, ...]:
    return (hang(32), sphere(32)) if quick else (hang(32), hang(64), hang(128), sphere(32), sphere(64))


def _own(scene: Scene, settings: Mapping[str, Value]) -> Measured:
    try:
        ended, timing = timed_run(scene, StepConfig.model_validate(settings), budget=_PATIENCE)
    except DivergedError:
        return Timing(0.0), {"status": "diverged"}
    assert ended is not None  # only a limit on the time would leave it out
    return timing, {"status": "ended", **measures(scene, ended[0])}


TRADE = Trade(("rms_stretch",), lambda quick: lambda row: row.method == "default")
