"""A draped garment carried through the motion of its body, frame by frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from vto_pipeline.cloth.dynamics.warm_up import warm_up
from vto_pipeline.cloth.judge.limits import fabric_limits, tell_beyond
from vto_pipeline.cloth.judge.strain import cloth_triangles
from vto_pipeline.cloth.model.build import build_cloth
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.moving.config import FollowConfig
from vto_pipeline.cloth.moving.frame import FrameStepper, moment_from
from vto_pipeline.cloth.moving.frame_audit import audit_frame
from vto_pipeline.cloth.placement.clear_body import OVERSTRETCHED
from vto_pipeline.errors import SimulationError
from vto_pipeline.io.runs.frame_log import FrameLog
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.motion import BodyPath, ClothMotion

_LATEST = 20  # frames whose time says how long the rest will take
_SHOWN = 5


def follow(
    garment: Garment,
    path: BodyPath,
    fabric: Fabric,
    settings: FollowConfig | Mapping[str, object] | None = None,
    job: Job | None = None,
    log: FrameLog | None = None,
) -> tuple[ClothMotion, dict[str, Any]]:
    """Carry a garment through the motion of its body.

    Each frame starts from positions and velocities of the last, so that cloth swings on when the body stops. Contacts,
    friction and internal friction are those of a drape.

    Args:
        garment: At rest on the body as the path begins.
        path: The body.
        fabric: What the garment is made of.
        settings: Keys of `FollowConfig`.
        job: For progress, findings and what was left out.
        log: Frames of an earlier run that was interrupted, and where new ones are kept.

    Returns:
        The frames, and what was found in each, as JSON values.

    Raises:
        ConfigError: an unknown setting or a value out of range.
        SimulationError: cloth is caught in a frame. `partial` holds the frames before as "draped_motion", and what was
            found in them as "motion_audit".
    """
    config, job, log = checked(FollowConfig, settings), job or Job(), log or FrameLog()
    job.progress(0.0, "compiling the kernels")
    warm_up()
    model = build_cloth(garment.mesh, garment.rest, fabric, materials=config, job=job)
    stepper = FrameStepper(model, garment, path, fabric, config, job)
    laid = cloth_triangles(garment.rest.corners(model.faces))

    def keep(*, steps: int, attempts: int, began: tuple[float, float]) -> None:
        assert log is not None
        body, state = stepper.body_at(path.time(len(log.frames))), stepper.now.state
        found = audit_frame(
            model,
            stepper.natural,
            laid,
            fabric,
            state,
            body,
            own_crossings=stepper.body.own_crossings(len(log.frames)),
            yields=stepper.body.depth(len(log.frames)),
            steps=steps,
            attempts=attempts,
            seconds=time.perf_counter() - began[0],
            cpu_seconds=time.process_time() - began[1],
        )
        log.add(state.positions, asdict(found), stepper.now.arrays())

    if log.frames:
        job.note(f"{len(log.frames)} frames of an interrupted run are kept")
        stepper.now = moment_from(log.state)
    else:
        keep(steps=0, attempts=0, began=_now())
    while len(log.frames) < path.frames:
        number, began = len(log.frames), _now()
        job.progress(number / path.frames, _pace(number, path.frames, log.records))
        reached = stepper.go_to(number)
        if reached.why:
            raise SimulationError(
                f"cloth is caught in frame {number} of {path.frames}, at {path.time(number):.2f} s: {reached.why}",
                hint="a body that jumps or closes on the cloth leaves it no way: look at the motion there, or slow it",
                partial={
                    "draped_motion": ClothMotion(np.array(log.frames), model.faces, path.frame_time),
                    "motion_audit": summary(log.records, fabric),
                },
            )
        keep(steps=reached.steps, attempts=reached.attempts, began=began)
    found = summary(log.records, fabric)
    job.measure(**{name: value for name, value in found.items() if name != "per_frame"})
    _warn(found, job)
    tell_beyond(found["fabric_limits"], found["beyond_limits"], fabric.name, job, " in a frame")
    return ClothMotion(np.array(log.frames), model.faces, path.frame_time), found


def _now() -> tuple[float, float]:
    """Return wall and processor time [s]."""
    return time.perf_counter(), time.process_time()


def summary(records: Sequence[Mapping[str, Any]], fabric: Fabric) -> dict[str, Any]:
    """Return the worst of all frames, then each, as JSON values."""
    limits = fabric_limits(fabric)

    def most(name: str) -> float:
        return max(record[name] for record in records)

    def most_beyond(name: str) -> float | None:
        return None if limits[name] is None else max(record["beyond_limits"][name] for record in records)

    return {
        "frames": len(records),
        "frames_crossing_body": sum(record["body_crossings"] > 0 for record in records),
        "frames_crossing_itself": sum(record["self_crossings"] > 0 for record in records),
        "frames_overstretched": sum(_is_overstretched(record) for record in records),
        "frames_body_crossing_itself": sum(record["own_crossings"] > 0 for record in records),
        "most_body_crossings": most("body_crossings"),
        "most_self_crossings": most("self_crossings"),
        "penetration_mm": most("penetration_mm"),
        "body_yields_mm": most("yields_mm"),
        **{name: most(name) for name in ("max_stretch", "max_thread_stretch", "p99_thread_stretch", "max_shear_deg")},
        "fabric_limits": limits,
        "beyond_limits": {name: most_beyond(name) for name in limits},
        "seconds_per_frame": float(np.median([record["seconds"] for record in records])),
        "cpu_seconds_per_frame": float(np.median([record["cpu_seconds"] for record in records])),
        "most_cpu_seconds": most("cpu_seconds"),
        "per_frame": [dict(record) for record in records],
    }


def _is_overstretched(record: Mapping[str, Any]) -> bool:
    """Return whether an edge is longer than any cloth lets it be: such a frame is no picture of how it fits."""
    return bool(1.0 + record["max_stretch"] > OVERSTRETCHED)


def _warn(found: Mapping[str, Any], job: Job) -> None:
    """Warn of each kind of frame that shows what cannot be, and of which they are."""
    records = found["per_frame"]

    def frames(is_wrong: Callable[[Mapping[str, Any]], bool]) -> str:
        places = [str(k) for k, record in enumerate(records) if is_wrong(record)]
        shown = ", ".join(places[:_SHOWN]) + (" ..." if len(places) > _SHOWN else "")
        return f"{len(places)} frames: {shown}" if places else ""

    if told := frames(lambda record: record["body_crossings"] > 0):
        job.warn(f"the garment crosses the body in {told}")
    if told := frames(lambda record: record["self_crossings"] > 0):
        job.warn(f"the garment crosses itself in {told}")
    if told := frames(_is_overstretched):
        job.warn(
            f"the cloth is stretched as none can be, by up to {found['max_stretch']:.0%}, in {told}: "
            "it is too small for this motion, or caught"
        )


def _pace(number: int, frames: int, records: Sequence[Mapping[str, Any]]) -> str:
    """Return which frame is next, and how long the rest will take."""
    latest = [record["seconds"] for record in records[1:][-_LATEST:]]
    if not latest:
        return f"frame {number} of {frames}"
    left = (frames - number) * sum(latest) / len(latest)
    return f"frame {number} of {frames}, about {left:.0f} s left"
